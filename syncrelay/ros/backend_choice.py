"""Which backend messages pass through: the compiled one where it proves itself, or the one that is asked for."""

import logging
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final, NamedTuple

from syncrelay.dataflow.backend import BackendName, RclBackend, RclCallError
from syncrelay.errors import RosUnavailableError, UsageError
from syncrelay.ros.rclpy_backend import RclpyBackend
from syncrelay.sync.compiled import source_fingerprint

VARIABLE: Final = "SYNCRELAY_RECEIVE"
"""The environment variable that names the backend, a BackendName."""
RCLPY_COSTS: Final = "a message costs about 1.5 times the CPU, and one of 1 MB 2.5 times"
"""Compared with the compiled path; docs/explanation/cost.md has the measurements."""

_LOG = logging.getLogger("syncrelay")
_WORDS: Final = {
    BackendName.COMPILED: "messages pass through librcl, in compiled code",
    BackendName.RCLPY: "messages pass through rclpy",
}


class CompiledFault(NamedTuple):
    """Why the compiled path is not used, and what to do about it."""

    what: str
    advice: str


_NOT_BUILT: Final = CompiledFault(
    "the compiled path was not built",
    "install a C compiler (apt install gcc libc6-dev python3-dev) and then syncrelay again,"
    " or install a release's wheel, which has it built",
)
# Only a clone has the source beside what was built from it.
_OUTDATED: Final = CompiledFault(
    "the compiled path was built from another version of path.pyx", "run `pip install -e .` in the clone of syncrelay"
)


def choose_backend(asked: str | None, *, node: Any, context: Any) -> RclBackend:
    """Return the backend that messages pass through in this process, and log which it is. Raises as `find_backend`."""
    backend, fault = find_backend(asked, node=node, context=context)
    if asked:
        _LOG.info("%s, as %s asks", _WORDS[backend.name], VARIABLE)
    elif fault is not None:
        _LOG.warning("%s, where %s: %s; %s", _WORDS[backend.name], RCLPY_COSTS, *fault)
    else:
        _LOG.info("%s", _WORDS[backend.name])
    return backend


def find_backend(asked: str | None, *, node: Any, context: Any) -> tuple[RclBackend, CompiledFault | None]:
    """Return the backend that is asked for, or the best that works here and what is wrong with a better one.

    Raises UsageError for an unknown name, RosUnavailableError where the compiled one is asked for and cannot be used.
    """
    name = _name(asked) if asked else None
    fault = None
    if name is not BackendName.RCLPY:
        compiled = _compiled(node)
        if not isinstance(compiled, CompiledFault):
            return compiled, None
        fault = compiled
        if name is BackendName.COMPILED:
            raise RosUnavailableError(f"{VARIABLE}={asked}: {fault.what}\n  {fault.advice}")
    return RclpyBackend(context), fault


def _compiled(node: Any) -> RclBackend | CompiledFault:
    spec = find_spec("syncrelay.ros.compiled.path")
    if spec is None:
        return _NOT_BUILT
    try:
        fingerprint = source_fingerprint()
        # Looked for in the file: code of another version is not even loaded.
        if fingerprint is not None and fingerprint.encode() not in Path(str(spec.origin)).read_bytes():
            return _OUTDATED
        from syncrelay.ros.compiled.backend import proven_backend  # noqa: PLC0415  it may not be there

        return proven_backend(node)
    # OSError and AttributeError: librcl, or a function of it, is missing.
    except (OSError, ImportError, AttributeError, RclCallError) as error:
        return CompiledFault(
            f"the compiled path does not work here ({error})",
            "install syncrelay again; if this stays, please report it, with the first line of `syncrelay doctor`",
        )


def _name(asked: str) -> BackendName:
    try:
        return BackendName(asked)
    except ValueError as error:
        valid = " or ".join(name.value for name in BackendName)
        raise UsageError(f"{VARIABLE}={asked}: expected {valid}") from error
