"""Takes out of an environment with the ROS wheels what syncrelay alone needs, and syncrelay itself."""

import re
import sys
from importlib.metadata import Distribution, distributions
from pathlib import Path


def main(prefix: Path) -> None:
    (packages,) = prefix.glob("lib/python3*/site-packages")
    there = {_plain(each.metadata["Name"]): each for each in distributions(path=[str(packages)])}
    ros = _needed([name for name in there if name.startswith("ros-")], there)
    for name in _needed(["syncrelay"], there) - ros:
        for file in there[name].files or ():
            Path(str(file.locate())).unlink(missing_ok=True)


def _needed(names: list[str], there: dict[str, Distribution]) -> set[str]:
    """The distributions of these names, and what they need."""
    needed: set[str] = set()
    left = [name for name in names if name in there]
    while left:
        name = left.pop()
        if name not in needed:
            needed.add(name)
            asked = [re.split(r"[^\w.-]", line)[0] for line in there[name].requires or () if "extra ==" not in line]
            left += [each for each in map(_plain, asked) if each in there]
    return needed


def _plain(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
