"""Python, rclpy, wheels and middlewares: what is here, and whether it belongs together. Nothing of ROS is imported."""

import importlib.util
import os
import platform
import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Final

from syncrelay.config.wording import all_of
from syncrelay.doctor.diagnosis import Diagnosis, error
from syncrelay.ros.environment import middlewares

WHEEL_PYTHONS: Final = ((3, 11), (3, 12))
"""The versions of Python for which the ROS 2 Jazzy wheels are built."""
WHEEL_MACHINE: Final = "x86_64"

_DEFAULT: Final = "rmw_fastrtps_cpp"
_INSTALL_WHEELS: Final = "in a clone of syncrelay: pip install '.[ros]' (x86_64, Python 3.11 or 3.12, no ROS sourced)"
_INDEX: Final = Path("share/ament_index/resource_index")
_COMPILED: Final = re.compile(r"\.cpython-(\d)(\d+)-")


@dataclass(frozen=True, slots=True)
class Installation:
    """What is installed.

    `rclpy` is the folder of the package that Python finds, `version` what its metadata say, `built_for` the versions
    of Python that its compiled part serves, none where that cannot be told. `wheels` says whether rclpy is installed
    as a wheel, `sourced` lists other prefixes with a ROS in them that the environment names, `unsourced` those on the
    disk that it does not. `middlewares` are registered in the ament index.
    """

    python: tuple[int, int]
    executable: str
    machine: str
    distribution: str | None
    rclpy: Path | None
    version: str | None
    built_for: tuple[tuple[int, int], ...]
    wheels: bool
    sourced: tuple[Path, ...]
    unsourced: tuple[Path, ...]
    middlewares: tuple[str, ...]
    middleware_asked: str | None


def middleware_of(found: Installation) -> str:
    """Return the middleware that ROS takes: what is asked for, else its default, else any; empty for none."""
    if found.middleware_asked:
        return found.middleware_asked
    return _DEFAULT if _DEFAULT in found.middlewares else next(iter(found.middlewares), "")


def check_installation(found: Installation) -> Iterator[Diagnosis]:
    """Yield what keeps rclpy from being used, the first cause first."""
    if found.rclpy is None:
        yield _no_rclpy(found)
        return
    if found.built_for and found.python not in found.built_for:
        yield _other_python(found)
    if found.wheels and found.sourced:
        places = all_of(str(prefix) for prefix in found.sourced)
        yield error(
            "two_ros",
            f"ROS 2 is sourced ({places}), and its wheels are installed in this Python too",
            impact="two sets of the same libraries meet in one process: it crashes, or types are not found",
            fix="start from a shell without ROS sourced, or use a venv without the wheels:\n"
            "python3 -m venv --system-site-packages, then pip install . in a clone of syncrelay",
        )
    yield from _middleware(found)


def _no_rclpy(found: Installation) -> Diagnosis:
    what = f"rclpy is not installed in {_python(found)}"
    impact = "ROS cannot be used here: the relay does not start, and --live cannot look at the graph"
    if found.sourced or found.distribution:
        name = found.distribution or found.sourced[0]
        return error(
            "no_rclpy",
            f"{what}, though ROS 2 ({name}) is sourced",
            impact=impact,
            fix="use the Python that this ROS was built for, in a venv made with:\n"
            "python3 -m venv --system-site-packages",
        )
    if found.unsourced:
        return error(
            "no_rclpy",
            f"{what}: ROS 2 is installed at {found.unsourced[-1]} but not sourced",
            impact=impact,
            fix=f"source {found.unsourced[-1]}/setup.bash    and start syncrelay from that shell",
        )
    return error("no_rclpy", what, impact=impact, fix=_way_to_rclpy(found))


def _way_to_rclpy(found: Installation) -> str:
    if found.machine != WHEEL_MACHINE:
        return f"install ROS 2 Jazzy from packages and source it: there are no wheels for {found.machine}"
    if found.python not in WHEEL_PYTHONS:
        versions = " and ".join(f"{major}.{minor}" for major, minor in WHEEL_PYTHONS)
        return f"make the venv with another Python: the wheels are for {versions}; or source a ROS 2 built for this one"
    return f"{_INSTALL_WHEELS};\nor, where ROS 2 is installed: source /opt/ros/jazzy/setup.bash"


def _other_python(found: Installation) -> Diagnosis:
    versions = all_of(f"{major}.{minor}" for major, minor in found.built_for)
    return error(
        "other_python",
        f"rclpy at {found.rclpy} is built for Python {versions}, this is {_python(found)}",
        impact="import rclpy fails: its compiled part does not load",
        fix=f"start syncrelay with Python {versions}, or install rclpy for this one",
    )


def _middleware(found: Installation) -> Iterator[Diagnosis]:
    asked, there = found.middleware_asked, found.middlewares
    if not there:
        yield error(
            "no_middleware",
            "rclpy is installed without a middleware (no rmw_... in the ament index)",
            impact="import rclpy fails: nothing can send or receive",
            fix="pip install 'ros-jazzy-rclpy[fastrtps]'    where rclpy is a wheel;\n"
            "else: apt-get install ros-jazzy-rmw-fastrtps-cpp, and source ROS again",
        )
    elif asked and asked not in there:
        package = f"ros-{found.distribution or 'jazzy'}-{asked.replace('_', '-')}"
        yield error(
            "middleware_not_there",
            f"RMW_IMPLEMENTATION asks for {asked}, which is not installed here; installed: {', '.join(there)}",
            impact="ROS ends the whole process when rclpy is imported, without an exception",
            fix=f"unset RMW_IMPLEMENTATION    or install {asked} ({package}).\n"
            "All nodes of a robot should use one middleware",
        )


def _python(found: Installation) -> str:
    return f"Python {found.python[0]}.{found.python[1]} ({found.executable})"


def look_at_installation(environ: Mapping[str, str]) -> Installation:
    """Return what Python would import, and what the environment names beside it."""
    prefixes = _listed(environ, "AMENT_PREFIX_PATH")
    spec = importlib.util.find_spec("rclpy")
    rclpy = Path(spec.origin).parent if spec and spec.origin else None
    own = Path(sys.prefix).resolve()
    return Installation(
        python=sys.version_info[:2],
        executable=sys.executable,
        machine=platform.machine(),
        distribution=environ.get("ROS_DISTRO"),
        rclpy=rclpy,
        # Of a wheel the distribution's own is right; the metadata of the package within lag behind.
        version=_version_of("ros-rclpy") or _version_of("rclpy"),
        built_for=tuple(_built_for(rclpy)) if rclpy else (),
        wheels=_version_of("ros-rclpy") is not None,
        sourced=tuple(prefix for prefix in prefixes if _holds_ros(prefix) and prefix.resolve() != own),
        unsourced=tuple(sorted(path.parent for path in Path("/opt/ros").glob("*/setup.bash"))),
        middlewares=tuple(middlewares([*prefixes, own])),
        middleware_asked=environ.get("RMW_IMPLEMENTATION") or None,
    )


def _version_of(distribution: str) -> str | None:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return None


def _listed(environ: Mapping[str, str], name: str) -> list[Path]:
    return [Path(entry) for entry in environ.get(name, "").split(os.pathsep) if entry]


def _holds_ros(prefix: Path) -> bool:
    """Whether a prefix is a ROS, not just a workspace of somebody's messages."""
    return (prefix / _INDEX / "packages/rclpy").exists() or (prefix / "lib/librcl.so").exists()


def _built_for(folder: Path) -> Iterator[tuple[int, int]]:
    for path in sorted(folder.glob("_rclpy_pybind11.*.so")):
        if found := _COMPILED.search(path.name):
            yield int(found[1]), int(found[2])
