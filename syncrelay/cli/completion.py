"""`syncrelay completion SHELL`, and what its script asks for at every press of TAB.

argcomplete finds out what the line expects next, and speaks with the shells. The metavar of an argument selects what
completes it. Nothing slow is imported; a file or a recording is read only where its content completes the word.
"""

import os
import re
import signal
from argparse import Namespace
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, suppress
from pathlib import Path
from typing import Any, Final

from argcomplete.finders import ExclusiveCompletionFinder
from argcomplete.lexers import split_line
from argcomplete.shell_integration import shellcode

from syncrelay.cli import run
from syncrelay.cli.boundary import DONE, put
from syncrelay.cli.commands import COMMANDS
from syncrelay.cli.parser import IMAGE_FORMATS, ROS_ARGS, Parser
from syncrelay.cli.stop import StopRequest
from syncrelay.printable import printable
from syncrelay.yaml_files import group_names, yaml_files

_PROGRAM: Final = "syncrelay"
# Processor time: a recording without an index, or one that is compressed as a whole, may take long to open.
_PATIENCE_S: Final = 2.0
# The limit of syncrelay.config, which takes too long to import at a press of TAB.
_MOST_BYTES: Final = 1_000_000
# Words that may stand before the program's name, as zsh passes the whole line.
_BEFORE: Final = re.compile(r".*[;&|({]|\w+=.*|sudo|env|exec|nice|nohup|time|!")

# As argcomplete calls it: with `prefix`, which is typed already, `parsed_args`, and more that none of these needs.
_Completer = Callable[..., Iterable[str] | Mapping[str, str]]


def parser() -> Parser:
    parser = Parser(
        "syncrelay completion",
        example="syncrelay completion fish > ~/.config/fish/completions/syncrelay.fish",
        description="Prints a script that makes a shell complete syncrelay's commands, options and files, the groups "
        "of a file and the topics of a recording.",
        epilog="where to put it:\n"
        "  bash  ~/.local/share/bash-completion/completions/syncrelay\n"
        "  zsh   _syncrelay in a folder of $fpath, before compinit\n"
        "  fish  ~/.config/fish/completions/syncrelay.fish\n",
    )
    parser.add_argument("shell", metavar="SHELL", choices=("bash", "zsh", "fish"), help="bash, zsh or fish")
    return parser


def command(_parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    put(shellcode([_PROGRAM], shell=arguments.shell).strip())
    return DONE


def complete() -> int:
    """Print the words that may stand at the cursor of the line in argcomplete's variables.

    After 2 s of processor time the kernel ends the process.
    """
    signal.setitimer(signal.ITIMER_PROF, _PATIENCE_S)
    before = split_line(os.environ["COMP_LINE"], int(os.environ["COMP_POINT"]))[3]
    start = max((place for place in range(len(before)) if _is_start(before, place)), default=0)
    words = before[start + 1 :]
    if ROS_ARGS in words:
        return DONE
    has_command = bool(words) and words[0] in COMMANDS
    parser = COMMANDS[words[0]].parser() if has_command else run.parser()
    if not words:
        # The first word may be a command, or an option of the relay.
        parser.add_argument("command", metavar="COMMAND", nargs="?")
    parser.add_help_option()
    for action in parser.actions:
        if action.choices is None:
            action.completer = COMPLETERS.get(str(action.metavar), _nothing)  # type: ignore[attr-defined]
    has_positionals = any(not action.option_strings for action in parser.actions)
    os.environ["_ARGCOMPLETE"] = str(start + 1 + has_command)
    ExclusiveCompletionFinder()(
        parser,
        # Where a file is expected, options are offered only after a dash.
        # argcomplete would exit; the process ends as after any command.
        exit_method=lambda _code: None,
        always_complete_options=False if has_positionals and words else "long",
        validator=lambda completion, typed: completion.startswith(typed) and printable(completion) == completion,
    )
    return DONE


def _is_start(words: Sequence[str], place: int) -> bool:
    is_program = Path(words[place]).name == _PROGRAM
    return is_program and (place == 0 or _BEFORE.fullmatch(words[place - 1]) is not None)


def _nothing(**_: Any) -> Iterable[str]:
    return ()


def _image_formats(*, prefix: str, **_: Any) -> Iterable[str]:
    topic = "".join(prefix.rpartition("=")[:2])
    return [f"{topic}{each}" for each in IMAGE_FORMATS]


def _commands(**_: Any) -> Mapping[str, str]:
    return {name: command.does for name, command in COMMANDS.items()}


def _files(pattern: str) -> _Completer:
    """Return what completes the names of files that match, and of folders on the way to them."""
    wanted = re.compile(pattern)

    def complete_file(*, prefix: str, **_: Any) -> Iterator[str]:
        folder, slash, begun = prefix.rpartition("/")
        with suppress(OSError):
            for entry in sorted(Path(folder + slash or ".").expanduser().iterdir()):
                if entry.name.startswith(".") and not begun.startswith("."):
                    continue
                if entry.is_dir():
                    yield f"{folder}{slash}{entry.name}/"
                elif wanted.fullmatch(entry.name):
                    yield f"{folder}{slash}{entry.name}"

    return complete_file


def _groups(*, parsed_args: Namespace, **_: Any) -> Iterator[str]:
    """Give the groups of the files that --config names; none of a file that is not valid YAML."""
    for name in parsed_args.config or ():
        with suppress(OSError):
            for path in map(Path, yaml_files(str(Path(name).expanduser()))):
                # Reading a pipe would wait for it, and empty it.
                if path.is_file():
                    with path.open("rb") as file:
                        yield from group_names(file.read(_MOST_BYTES))


def _recordings_and_topics(*, prefix: str, parsed_args: Namespace, **_: Any) -> Iterator[str]:
    """Give the topics of the recording that is named first; where none begins so, more recordings."""
    from syncrelay.errors import BagError
    from syncrelay.recordings.bag import is_url, open_recording

    topics = set[str]()
    # Nobody pays for a press of the Tab key, or waits for a server.
    if not is_url(parsed_args.bag):
        with suppress(BagError), closing(open_recording([parsed_args.bag])) as recording:
            topics = {channel.topic for channel in recording.channels} - set(parsed_args.more)
    begun = sorted(topic for topic in topics if topic.startswith(prefix))
    yield from begun or _files(_RECORDING)(prefix=prefix)


_YAML: Final = r".*\.ya?ml"
_RECORDING: Final = r".*\.(mcap|db3|bag|active)(\.(bz2|zstd|zst|gz))?"
COMPLETERS: Final[Mapping[str, _Completer]] = {
    "COMMAND": _commands,
    "FILE": _files(_YAML),
    "OLD": _files(_YAML),
    "NEW": _files(_YAML),
    "NAME": _groups,
    "BAG": _files(_RECORDING),
    "OUT": _files(_RECORDING),
    # No file's name is empty: only folders are left.
    "FOLDER": _files(""),
    "BAG|TOPIC": _recordings_and_topics,
    "[TOPIC=]FORMAT": _image_formats,
    "REPORT": _files(r".*\.html"),
}
"""What completes a word, by its metavar. Where there are choices they do, and a number or a URL nothing does."""
