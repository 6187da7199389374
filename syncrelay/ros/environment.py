"""Prepares the process for rclpy, and says what to do when ROS cannot be used here."""

import contextlib
import importlib
import importlib.util
import io
import os
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

from syncrelay.collector import resting_collector
from syncrelay.errors import RosUnavailableError

_STDOUT, _STDERR = 1, 2
_WHEELS = "pip install '.[ros]'                in a clone of syncrelay: x86_64, Python 3.11 or 3.12, no other ROS"
_SOURCED = "source /opt/ros/jazzy/setup.bash    where ROS 2 is installed; then start syncrelay from that shell"


@resting_collector()
def require_rclpy() -> None:
    """Import rclpy, or raise RosUnavailableError saying which way to ROS is missing and how to mend it.

    The wheels leave AMENT_PREFIX_PATH unset, so that rclpy finds no resource index: it is set to the
    environment's own prefix where that holds one.
    """
    prefix = Path(sys.prefix)
    if not os.environ.get("AMENT_PREFIX_PATH") and (prefix / "share/ament_index").is_dir():
        os.environ["AMENT_PREFIX_PATH"] = str(prefix)
    if importlib.util.find_spec("rclpy") is None:
        raise RosUnavailableError(_without_rclpy())
    _require_middleware(os.environ.get("RMW_IMPLEMENTATION"))
    try:
        importlib.import_module("rclpy")
    except ImportError as error:
        raise RosUnavailableError(_without_middleware(error)) from error
    _import_type_support()


def _import_type_support() -> None:
    """Import what message types need of rosidl_generator_py, without its code generator.

    The package does without the generator where its imports (em, lark) fail. They take a ninth of the CPU of a bare
    rclpy node.
    """
    generator = "rosidl_generator_py.generate_py_impl"
    sys.modules.setdefault(generator, None)  # type: ignore[arg-type]  # None makes an import fail
    with contextlib.suppress(ImportError):
        importlib.import_module("rosidl_generator_py")
    if sys.modules[generator] is None:
        del sys.modules[generator]


def keep_stdout() -> None:
    """Keep stdout for our own output: what Fast DDS prints there goes to stderr from now on.

    To be called before rclpy starts. A stdout that is not the process's own, as under a test, stays as it is.
    """
    before = sys.stdout
    if before is not sys.__stdout__ or not isinstance(before, io.TextIOWrapper) or before.fileno() != _STDOUT:
        return
    with contextlib.suppress(OSError):
        before.flush()
        own = os.dup(_STDOUT)
        os.dup2(_STDERR, _STDOUT)
        sys.stdout = os.fdopen(own, "w", encoding=before.encoding, errors=before.errors, buffering=1)


def _require_middleware(asked: str | None) -> None:
    """Refuse a middleware that is not installed: rcl would end the whole process without an exception."""
    prefixes = [Path(prefix) for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]
    installed = middlewares(prefixes)
    if asked and installed and asked not in installed:
        distribution = os.environ.get("ROS_DISTRO") or "jazzy"
        raise RosUnavailableError(
            f"RMW_IMPLEMENTATION asks for {asked}, which is not installed here; there is {', '.join(installed)}.\n"
            f"  Install it (ros-{distribution}-{asked.replace('_', '-')}), or `unset RMW_IMPLEMENTATION`."
        )


def middlewares(prefixes: Iterable[Path]) -> list[str]:
    """Return the middlewares that are registered in the ament index of these prefixes."""
    index = "share/ament_index/resource_index/rmw_typesupport"
    found = {entry.name for prefix in prefixes for entry in (prefix / index).glob("*")}
    return sorted(found - {"rmw_implementation"})


def _without_rclpy() -> str:
    python = f"Python {sys.version_info.major}.{sys.version_info.minor} ({sys.executable})"
    distribution = os.environ.get("ROS_DISTRO")
    if distribution:
        return (
            f"ROS 2 {distribution} is sourced, but {python} does not find its rclpy.\n"
            "  Use the Python that this ROS was built for, in a venv made with --system-site-packages,\n"
            "  or start from a shell without ROS and install the wheels:\n"
            f"    {_WHEELS}"
        )
    installed = sorted(path.parent for path in Path("/opt/ros").glob("*/setup.bash"))
    if installed:
        return (
            f"rclpy is not installed in {python}, and ROS 2 is installed at {installed[-1]} but not sourced.\n"
            f"    source {installed[-1]}/setup.bash"
        )
    return f"rclpy is not installed in {python}. Either way brings it:\n    {_WHEELS}\n    {_SOURCED}"


def _without_middleware(error: ImportError) -> str:
    # rclpy raises its own advice behind the loader's sentence; the first line holds the cause.
    cause = str(error).splitlines()[0] if str(error) else type(error).__name__
    return (
        f"rclpy is installed but cannot be imported: {cause}\n"
        "  Its middleware is missing or belongs to another ROS. Either install it with its middleware:\n"
        f"    {_WHEELS}\n"
        "  or use a ROS 2 installation that has one:\n"
        f"    {_SOURCED}"
    )


def log_arguments() -> list[str]:
    """ROS arguments that keep rclpy from failing where no log folder can be written.

    rclpy raises at start when HOME is unset or the folder is read-only, as in a container.
    """
    folder = log_folder(os.environ)
    return [] if folder is not None and _writable(folder) else ["--disable-external-lib-logs"]


def log_folder(environ: Mapping[str, str]) -> Path | None:
    """Return where ROS writes its log files; None where the environment names no place."""
    if folder := environ.get("ROS_LOG_DIR"):
        return Path(folder)
    if folder := environ.get("ROS_HOME"):
        return Path(folder, "log")
    return Path(environ["HOME"], ".ros", "log") if environ.get("HOME") else None


def _writable(folder: Path) -> bool:
    # ROS itself would make it. For root, its permissions alone would not tell.
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK | os.X_OK)
