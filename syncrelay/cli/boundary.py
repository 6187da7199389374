"""The one error boundary: what a command raises becomes text on stderr and an exit code."""

import io
import os
import sys
import traceback
from collections.abc import Callable
from typing import Final, TextIO

from syncrelay.errors import RosUnavailableError, SyncRelayError, UsageError

DONE: Final = 0
AT_FAULT: Final = 1
"""The user's file or data is at fault, or a check found something."""
USAGE: Final = 2
ROS_UNAVAILABLE: Final = 69
OUR_BUG: Final = 70
INTERRUPTED: Final = 130


def guarded(command: Callable[[], int]) -> int:
    """Run a command and return its exit code, or that of the error it raised."""
    try:
        return _guarded(command)
    finally:
        try:
            sys.stderr.flush()
        except OSError:
            # The terminal is gone, which is how the relay was ended: no failure of its own.
            _abandon(sys.stderr)


def _guarded(command: Callable[[], int]) -> int:
    if isinstance(sys.stdout, io.TextIOWrapper):
        # A file's name or line may hold what the terminal's encoding lacks.
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        code = command()
        _to_stdout(sys.stdout.flush)
    except SyncRelayError as error:
        say(_text(error))
        return _code(error)
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:
        # Who read us has seen enough.
        _abandon(sys.stdout)
        return AT_FAULT
    except Exception:  # noqa: BLE001  the boundary: everything else is our bug
        say(traceback.format_exc())
        say("syncrelay: this is a bug in syncrelay, please report it with the lines above and your file")
        return OUR_BUG
    return code


def say(text: str) -> None:
    """Print talk on stderr."""
    sys.stderr.write(f"{text}\n")
    sys.stderr.flush()


def put(text: str) -> None:
    """Print what was asked for on stdout."""
    _to_stdout(lambda: sys.stdout.write(f"{text}\n"))


def wants_colour(is_terminal: bool) -> bool:  # noqa: FBT001  the answer of isatty
    """Tell whether output may be coloured (https://no-color.org)."""
    return is_terminal and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def _to_stdout(write: Callable[[], object]) -> None:
    try:
        write()
    except OSError as error:
        _abandon(sys.stdout)
        if isinstance(error, BrokenPipeError):
            raise
        raise SyncRelayError(f"standard output cannot be written: {error.strerror}") from error


def _abandon(stream: TextIO) -> None:
    """Keep the interpreter from flushing once more, as it ends, what nobody takes."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _text(error: SyncRelayError) -> str:
    from syncrelay.config.errors import ConfigError
    from syncrelay.config.render import render

    if isinstance(error, ConfigError):
        return render(error.problems, colour=wants_colour(sys.stderr.isatty()))
    return f"syncrelay: {error}"


def _code(error: SyncRelayError) -> int:
    match error:
        case UsageError():
            return USAGE
        case RosUnavailableError():
            return ROS_UNAVAILABLE
        case _:
            return AT_FAULT
