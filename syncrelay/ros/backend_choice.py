"""Which backend messages pass through: the cheapest that proves itself here, or the one that is asked for."""

import logging
from importlib.util import find_spec
from typing import Any, Final

from syncrelay.dataflow.backend import BackendName, RclBackend
from syncrelay.errors import RosUnavailableError, UsageError
from syncrelay.ros.librcl.backend import LibrclBackend
from syncrelay.ros.librcl.check import LibrclUnusableError, checked_backend
from syncrelay.ros.rclpy_backend import RclpyBackend

VARIABLE: Final = "SYNCRELAY_RECEIVE"
"""The environment variable that names the backend, a BackendName; without it the cheapest is taken."""

_LOG = logging.getLogger("syncrelay")
_NOT_BUILT: Final = "the compiled path was not built: install syncrelay again where there is a C compiler"
_WORDS: Final = {
    BackendName.COMPILED: "messages pass through librcl, in compiled code",
    BackendName.LIBRCL: "messages pass through librcl, without a copy in Python",
    BackendName.RCLPY: "messages pass through rclpy",
}


def choose_backend(asked: str | None, *, node: Any, context: Any) -> RclBackend:
    """Return the backend that messages pass through in this process, and log which it is.

    Raises UsageError for an unknown name, RosUnavailableError where one is asked for by name and cannot be used.
    """
    name = _name(asked) if asked else None
    backend, fault = (RclpyBackend(context), "") if name is BackendName.RCLPY else _found(node, context, name)
    words = _WORDS[backend.name]
    if name is not None and name is not backend.name:
        raise RosUnavailableError(f"{VARIABLE}={asked}: {fault or _NOT_BUILT}")
    if name is not None:
        _LOG.info("%s, as %s asks", words, VARIABLE)
    elif fault:
        _LOG.warning("%s, at a higher cost: %s", words, fault)
    else:
        _LOG.info("%s", words)
    return backend


def find_backend(*, node: Any, context: Any) -> tuple[RclBackend, str]:
    """Return the cheapest backend that works here, and what is wrong with a cheaper one, or nothing."""
    return _found(node, context, None)


def _found(node: Any, context: Any, name: BackendName | None) -> tuple[RclBackend, str]:
    try:
        librcl = checked_backend(node)
    except LibrclUnusableError as error:
        return RclpyBackend(context), f"librcl is not as expected here ({error})"
    # It needs a compiler where syncrelay is installed, and nothing is wrong without it.
    if name is BackendName.LIBRCL or find_spec("syncrelay.ros.compiled.path") is None:
        return librcl, ""
    try:
        return _compiled(librcl, node), ""
    # Of another source it may lack a name that is asked for at the import.
    except (LibrclUnusableError, ImportError, AttributeError) as error:
        return librcl, f"the compiled path is not as expected here ({error})"


def _compiled(librcl: LibrclBackend, node: Any) -> RclBackend:
    from syncrelay.ros.compiled.check import compiled_backend  # noqa: PLC0415  it may not be there

    return compiled_backend(librcl.rcl, node)


def _name(asked: str) -> BackendName:
    try:
        return BackendName(asked)
    except ValueError as error:
        *others, last = [name.value for name in BackendName]
        raise UsageError(f"{VARIABLE}={asked}: expected {', '.join(others)} or {last}") from error
