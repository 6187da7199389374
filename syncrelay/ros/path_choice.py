"""Which path messages take: the direct one where it proves itself, rclpy's own elsewhere or when asked for."""

import logging
from typing import Any, Final

from syncrelay.errors import RosUnavailableError, UsageError
from syncrelay.ros.direct.check import DirectPathUnusableError, checked_path
from syncrelay.ros.path import Path, PathName
from syncrelay.ros.rclpy_path import RclpyPath

VARIABLE: Final = "SYNCRELAY_RECEIVE"
"""The environment variable that names the path, a PathName; without it the direct one is tried first."""

_LOG = logging.getLogger("syncrelay")


def choose_path(asked: str | None, *, node: Any, context: Any) -> Path:
    """Return the path that messages take in this process, and say in the log which it is.

    Raises UsageError for a name that is no path's, RosUnavailableError where the direct path is asked for by name
    and cannot be had.
    """
    name = _name(asked) if asked else None
    if name is PathName.RCLPY:
        _LOG.info("messages pass through rclpy, as %s asks", VARIABLE)
        return RclpyPath(context)
    try:
        path = checked_path(node)
    except DirectPathUnusableError as error:
        if name is PathName.DIRECT:
            raise RosUnavailableError(f"{VARIABLE}={asked}: librcl is not as expected here ({error})") from error
        _LOG.warning("messages pass through rclpy, at a higher cost: librcl is not as expected here (%s)", error)
        return RclpyPath(context)
    _LOG.info("messages pass through librcl, without a copy in Python")
    return path


def _name(asked: str) -> PathName:
    try:
        return PathName(asked)
    except ValueError as error:
        names = " or ".join(name.value for name in PathName)
        raise UsageError(f"{VARIABLE}={asked}: expected {names}") from error
