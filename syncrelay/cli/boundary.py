"""The one error boundary: what a command raises becomes text on stderr and an exit code."""

import io
import os
import re
import sys
import traceback
from collections.abc import Callable, Mapping
from typing import Final, TextIO

from syncrelay.cli.stop import TERMINATED, Terminated
from syncrelay.errors import NO_SPACE, SyncRelayError, UnavailableError, UsageError
from syncrelay.printable import one_entry, printable_lines

DONE: Final = 0
AT_FAULT: Final = 1
"""The user's file or data is at fault, or a check found something."""
USAGE: Final = 2
UNAVAILABLE: Final = 69
"""ROS, or a Python package that syncrelay needs, cannot be used here."""
OUR_BUG: Final = 70
INTERRUPTED: Final = 130

EXIT_CODES: Final[Mapping[int, str]] = {
    DONE: "done",
    AT_FAULT: "a problem in a file or data",
    USAGE: "wrong usage",
    UNAVAILABLE: "ROS or a package cannot be used",
    OUR_BUG: "a bug",
    INTERRUPTED: "interrupted",
    TERMINATED: "ended by SIGTERM",
}
"""Their meanings, as help and docs/reference/command_line.md give them."""

# The colours of our own texts (syncrelay.config.render, syncrelay.doctor.report); no other sequence reaches a terminal.
_COLOURS: Final = re.compile("(\033\\[(?:[0-2]|3[134])m)")


def guarded(command: Callable[[], int]) -> int:
    """Run a command and return its exit code, or that of the error it raised."""
    try:
        return _guarded(command)
    finally:
        try:
            sys.stderr.flush()
        except OSError:
            # The terminal was closed, which ended the relay: that is no failure.
            _abandon(sys.stderr)


def _guarded(command: Callable[[], int]) -> int:
    if isinstance(sys.stdout, io.TextIOWrapper):
        # File names and lines may have characters that the terminal's encoding lacks.
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        code = command()
        _to_stdout(sys.stdout.flush)
    except SyncRelayError as error:
        tell(error)
        return exit_code(error)
    except (KeyboardInterrupt, Terminated) as ended:
        return TERMINATED if isinstance(ended, Terminated) else INTERRUPTED
    except BrokenPipeError:
        # The reader has closed the pipe.
        _abandon(sys.stdout)
        return AT_FAULT
    except Exception as error:  # noqa: BLE001  the boundary: everything else is our bug
        return tell_machine_or_bug(error)
    return code


def tell_machine_or_bug(error: Exception) -> int:
    """Report a missing package or a full disk; anything else is our bug, and is shown with its traceback.

    Returns the exit code.
    """
    if isinstance(error, ImportError) and error.name and error.name.partition(".")[0] != "syncrelay":
        remark(_lacking(error, error.name.partition(".")[0]))
        return UNAVAILABLE
    if isinstance(error, OSError) and error.errno in NO_SPACE:
        where = f"{error.filename}: " if error.filename else ""
        remark(f"{where}cannot be written: {error.strerror}")
        return AT_FAULT
    say(traceback.format_exc())
    remark("this is a bug in syncrelay, please report it with the lines above and your file")
    return OUR_BUG


def say(text: str) -> None:
    """Print text on stderr, made safe as by `put`; that it cannot be written is ignored."""
    try:
        sys.stderr.write(f"{_safe(text, sys.stderr)}\n")
        sys.stderr.flush()
    except OSError:
        _abandon(sys.stderr)


def remark(sentence: str) -> None:
    """Print a sentence on stderr; its further lines are indented, so that none looks like another sentence."""
    say(f"syncrelay: {one_entry(sentence)}")


def put(text: str) -> None:
    """Print data on stdout: no control characters but newlines and, where colour is wanted, our colours."""
    _to_stdout(lambda: sys.stdout.write(f"{_safe(text, sys.stdout)}\n"))


def flush() -> None:
    """Flush stdout, so that whoever reads it through a pipe sees it at once."""
    _to_stdout(sys.stdout.flush)


def wants_colour(is_terminal: bool) -> bool:  # noqa: FBT001  the answer of isatty
    """Tell whether output may be coloured (https://no-color.org)."""
    return is_terminal and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def _safe(text: str, stream: TextIO) -> str:
    if text.isprintable() or not wants_colour(stream.isatty()):
        return printable_lines(text)
    # The colours that the pattern matches have the odd indices.
    parts = enumerate(_COLOURS.split(text))
    return "".join(part if at % 2 else printable_lines(part) for at, part in parts)


def _to_stdout(write: Callable[[], object]) -> None:
    try:
        write()
    except OSError as error:
        _abandon(sys.stdout)
        if isinstance(error, BrokenPipeError):
            raise
        raise SyncRelayError(f"standard output cannot be written: {error.strerror}") from error


def _abandon(stream: TextIO) -> None:
    """Point a stream at /dev/null, so that Python does not fail when it flushes the stream at its exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def tell(error: SyncRelayError) -> None:
    """Print what the user can mend; of a faulty file, every problem with its line."""
    if isinstance(error, UsageError | UnavailableError):
        # The import below takes far longer than reading the words did.
        remark(str(error))
        return
    from syncrelay.config import ConfigError, render

    if isinstance(error, ConfigError):
        say(render(error.problems, colour=wants_colour(sys.stderr.isatty())))
    else:
        remark(str(error))


def exit_code(error: SyncRelayError) -> int:
    """Return the code that a command ends with at this error."""
    match error:
        case UsageError():
            return USAGE
        case UnavailableError():
            return UNAVAILABLE
        case _:
            return AT_FAULT


def _lacking(error: ImportError, package: str) -> str:
    from syncrelay.cli.commands import EXTRAS, line_to_install

    extra = next((name for name, packages in EXTRAS.items() if package in packages), "")
    return (
        f"{sys.executable} lacks a Python package that syncrelay needs, or has too old a version: {error}\n"
        f"  {line_to_install(extra)}\n  for a ROS workspace, see docs/howto/workspace.md"
    )
