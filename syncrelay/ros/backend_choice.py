"""Which backend messages pass through: librcl where it proves itself, rclpy elsewhere or when asked for."""

import logging
from typing import Any, Final

from syncrelay.dataflow.backend import BackendName, RclBackend
from syncrelay.errors import RosUnavailableError, UsageError
from syncrelay.ros.librcl.check import LibrclUnusableError, checked_backend
from syncrelay.ros.rclpy_backend import RclpyBackend

VARIABLE: Final = "SYNCRELAY_RECEIVE"
"""The environment variable that names the backend, a BackendName; without it librcl is tried first."""

_LOG = logging.getLogger("syncrelay")


def choose_backend(asked: str | None, *, node: Any, context: Any) -> RclBackend:
    """Return the backend that messages pass through in this process, and log which it is.

    Raises UsageError for an unknown name, RosUnavailableError where librcl is asked for by name and cannot be used.
    """
    name = _name(asked) if asked else None
    if name is BackendName.RCLPY:
        _LOG.info("messages pass through rclpy, as %s asks", VARIABLE)
        return RclpyBackend(context)
    try:
        backend = checked_backend(node)
    except LibrclUnusableError as error:
        if name is BackendName.LIBRCL:
            raise RosUnavailableError(f"{VARIABLE}={asked}: librcl is not as expected here ({error})") from error
        _LOG.warning("messages pass through rclpy, at a higher cost: librcl is not as expected here (%s)", error)
        return RclpyBackend(context)
    _LOG.info("messages pass through librcl, without a copy in Python")
    return backend


def _name(asked: str) -> BackendName:
    try:
        return BackendName(asked)
    except ValueError as error:
        names = " or ".join(name.value for name in BackendName)
        raise UsageError(f"{VARIABLE}={asked}: expected {names}") from error
