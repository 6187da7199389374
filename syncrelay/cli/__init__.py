"""The command line: the only place that exits. Imports nothing slow, so that a signal is heard from the start."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path

from syncrelay.cli.stop import StopRequest, release_signals


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code; arguments default to those of the process."""
    _open_what_is_closed()
    words = sys.argv[1:] if arguments is None else list(arguments)
    stop = StopRequest()
    if _runs_until_stopped(words):
        stop.install()
    release_signals()
    # No model of ours has a use for them, and to find that there are none takes a look at every installed package.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    # Only now: what follows is imported with the signals in hand.
    from syncrelay.cli.boundary import guarded
    from syncrelay.cli.dispatch import dispatch

    return guarded(lambda: dispatch(words, stop=stop))


def _open_what_is_closed() -> None:
    """Give standard streams that were closed (`>&-`) to nobody: to Python they are None."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open(mode, encoding="utf-8"))  # noqa: SIM115  open as long as we run


def _runs_until_stopped(words: Sequence[str]) -> bool:
    """Tell the relay, which has options and no command, and the demo from commands that end by themselves."""
    if not words or words[0] != "demo":
        return bool(words) and words[0].startswith("-")
    return not any(word.startswith("--record") for word in words)
