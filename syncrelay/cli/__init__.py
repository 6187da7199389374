"""The command line: the only place that exits. Imports nothing slow, so that signals are handled from the start."""

import os
import sys
from collections.abc import Sequence

from syncrelay.cli.stop import TERMINATED, StopRequest, Termination, release_signals


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code; arguments default to those of the process."""
    words = sys.argv[1:] if arguments is None else list(arguments)
    _open_closed_streams()
    if not _runs_until_stopped(words):
        code = TERMINATED
        with Termination() as termination:
            code = _run(words, StopRequest())
        return TERMINATED if termination.came else code
    stop = StopRequest()
    stop.install()
    return _run(words, stop)


def _run(words: Sequence[str], stop: StopRequest) -> int:
    release_signals()
    # No model of ours uses plugins, and to search for them pydantic looks at every installed package.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    # Nothing here multiplies matrices, for which numpy would start a thread on every core.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Imported after the signal handlers are installed.
    from syncrelay.cli.boundary import guarded
    from syncrelay.cli.dispatch import dispatch

    code = guarded(lambda: dispatch(words, stop=stop))
    if "rclpy" in sys.modules:
        from syncrelay.ros.leaving import is_leaving

        if is_leaving():
            # The normal exit of Python would wait for DDS, which does not end.
            os._exit(code)
    return code


def _open_closed_streams() -> None:
    """Replace standard streams that a shell or an init has closed (`>&-`) by /dev/null.

    Otherwise the next file or socket that is opened gets the number of such a stream, and what is printed goes into it.
    """
    while (number := os.open(os.devnull, os.O_RDWR)) in (0, 1, 2):
        pass
    os.close(number)
    sys.stdin = sys.stdin or os.fdopen(0)
    sys.stdout = sys.stdout or os.fdopen(1, "w")
    sys.stderr = sys.stderr or os.fdopen(2, "w")


def _runs_until_stopped(words: Sequence[str]) -> bool:
    """Return whether the words start the relay, which has no command, or the demo: those run until stopped."""
    if not words or words[0] != "demo":
        return bool(words) and words[0].startswith("-")
    return not any(word.startswith("--record") for word in words)
