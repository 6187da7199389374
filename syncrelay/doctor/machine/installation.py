"""Which Python, rclpy, wheels and middlewares are here. Nothing of ROS is imported."""

import importlib.util
import os
import platform
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from importlib.metadata import Distribution, PackageNotFoundError, distributions, version
from pathlib import Path
from typing import Final

from packaging.requirements import InvalidRequirement, Requirement

from syncrelay.doctor.installation import Installation, Unmet

_INDEX: Final = Path("share/ament_index/resource_index")
_COMPILED: Final = re.compile(r"\.cpython-(\d)(\d+)-")


def look_at_installation(environ: Mapping[str, str]) -> Installation:
    """Return what Python would import, and what the environment names beside it."""
    prefixes = _listed(environ, "AMENT_PREFIX_PATH")
    rclpy = _folder_of("rclpy")
    wheels = {_normal(each.metadata["Name"]): each for each in distributions() if _is_wheel(each)}
    own = Path(sys.prefix).resolve()
    return Installation(
        python=sys.version_info[:2],
        executable=sys.executable,
        machine=platform.machine(),
        distribution=environ.get("ROS_DISTRO"),
        rclpy=rclpy,
        version=_version(),
        built_for=tuple(_built_for(rclpy)) if rclpy else (),
        wheels="ros-rclpy" in wheels,
        unmet=tuple(_unmet(wheels)),
        sourced=tuple(prefix for prefix in prefixes if _holds_ros(prefix) and prefix.resolve() != own),
        unsourced=tuple(sorted(path.parent for path in Path("/opt/ros").glob("*/setup.bash"))),
        middlewares=tuple(_middlewares([*prefixes, own])),
        middleware_asked=environ.get("RMW_IMPLEMENTATION") or None,
    )


def _version() -> str | None:
    # Of a wheel the distribution's own is right; the metadata of the package within lag behind.
    for name in ("ros-rclpy", "rclpy"):
        with suppress(PackageNotFoundError):
            return version(name)
    return None


def _listed(environ: Mapping[str, str], name: str) -> list[Path]:
    return [Path(entry) for entry in environ.get(name, "").split(os.pathsep) if entry]


def _folder_of(package: str) -> Path | None:
    spec = importlib.util.find_spec(package)
    return Path(spec.origin).parent if spec and spec.origin else None


def _holds_ros(prefix: Path) -> bool:
    """Whether a prefix is a ROS, not just a workspace of somebody's messages."""
    return (prefix / _INDEX / "packages/rclpy").exists() or (prefix / "lib/librcl.so").exists()


def _built_for(folder: Path) -> Iterator[tuple[int, int]]:
    for path in sorted(folder.glob("_rclpy_pybind11.*.so")):
        if found := _COMPILED.search(path.name):
            yield int(found[1]), int(found[2])


def _middlewares(prefixes: Iterable[Path]) -> list[str]:
    found = {entry.name for prefix in prefixes for entry in (prefix / _INDEX / "rmw_typesupport").glob("*")}
    return sorted(found - {"rmw_implementation"})


def _is_wheel(distribution: Distribution) -> bool:
    # A sourced ROS has distributions too, without the prefix of the wheels' names.
    return _normal(distribution.metadata["Name"] or "").startswith("ros-")


def _unmet(wheels: Mapping[str, Distribution]) -> Iterator[Unmet]:
    for name, wheel in sorted(wheels.items()):
        for needed in map(_requirement, wheel.requires or ()):
            if needed is None or not _normal(needed.name).startswith("ros-"):
                continue
            found = wheels.get(_normal(needed.name))
            if found is None or not needed.specifier.contains(found.version, prereleases=True):
                yield Unmet(
                    f"{name} {wheel.version}", f"{needed.name}{needed.specifier}", found.version if found else None
                )


def _requirement(text: str) -> Requirement | None:
    """Return a requirement that holds without any extra; None for others."""
    try:
        needed = Requirement(text)
    except InvalidRequirement:
        return None
    return needed if needed.marker is None or needed.marker.evaluate({"extra": ""}) else None


def _normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()
