"""argparse with our errors: one sentence, the nearest valid word, and where to read more."""

import argparse
import os
import shlex
from collections.abc import Callable, Sequence
from itertools import chain
from textwrap import fill
from typing import TYPE_CHECKING, Any, Final, NoReturn

from syncrelay.errors import UsageError
from syncrelay.recording_files import holds_recording
from syncrelay.yaml_files import yaml_files

if TYPE_CHECKING:
    from syncrelay.rig.what_if import Fault

ROS_ARGS: Final = "--ros-args"
_WIDTH: Final = 78
# 31 years: timers take it, and so do stamps.
_MOST_S: Final = 1_000_000_000
IMAGE_FORMATS: Final = ("png", "jpeg")
"""What `export --images` can make of an image."""
COMPRESSIONS: Final = ("zstd", "lz4", "none")
"""How `export` and `replay` can pack what they write."""

# The metavars of arguments that name YAML files to read.
_YAML_FILES: Final = ("FILE", "OLD", "NEW")


def folded(text: str) -> str:
    """Return a paragraph of help in lines, the second and later ones indented."""
    return fill(text, _WIDTH, subsequent_indent="  ")


def for_recording(path: str) -> str:
    """Return lines that say which commands are meant for a recording."""
    name = shlex.quote(path)
    commands = {
        f"analyze {name}": "what it holds",
        f"init --from-bag {name} -o NEW": "a file for it",
        f"replay {name} --config FILE": "the sets that a file makes of it",
        f"export {name} --config FILE -o FOLDER": "a dataset of these",
    }
    width = max(map(len, commands)) + 3
    return "".join(f"\n  syncrelay {command:<{width}}{gives}" for command, gives in commands.items())


class HelpRequested(Exception):  # noqa: N818  not an error
    """The words ask for help; its text is the only argument."""


class Parser(argparse.ArgumentParser):
    """A parser that raises UsageError, and HelpRequested where help is asked for, and never exits."""

    def __init__(self, prog: str, *, example: str, description: str, epilog: str = "", **options: Any) -> None:
        super().__init__(
            prog=prog,
            description=fill(description, _WIDTH),
            epilog=f"{epilog}\nexample: {example}".lstrip(),
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
            add_help=False,
            **options,
        )

    def error(self, message: str) -> NoReturn:
        """Raise UsageError with argparse's message."""
        raise UsageError(f"{message}\n  see {self.prog} --help")

    def add_repeatable(self, option: str, *, metavar: str, help: str, **more: Any) -> None:  # noqa: A002  as argparse
        """Add an option that may be given several times; its value is a list, which may be empty."""
        text = f"{help}; may be repeated"
        self.add_argument(option, metavar=metavar, action="append", default=[], help=text, **more)

    def read(self, words: Sequence[str], *, elsewhere: Callable[[str], str] = lambda _: "") -> argparse.Namespace:
        """Return the arguments, with what follows --ros-args, which the parser may have, as `ros_args`.

        An unknown argument is an error with what `elsewhere` says of that option, else with the nearest valid one.
        """
        self.add_help_option()
        own, ros_args = self._split(words)
        # Also where other words are wrong or missing.
        if "-h" in own or "--help" in own:
            raise HelpRequested(self.format_help())
        try:
            arguments, unknown = self.parse_known_args(own)
        except UsageError as error:
            # If a recording was named and something required is missing, show which commands take a recording.
            recordings = filter(holds_recording, own) if "required" in str(error) else ()
            for recording in recordings:
                raise UsageError(f"{error}{for_recording(recording)}") from error
            raise
        self._refuse_recordings(arguments)
        if unknown:
            from syncrelay.config.wording import did_you_mean

            word = unknown[0]
            options = [option for action in self._actions for option in action.option_strings]
            option = word.partition("=")[0]
            hint = (elsewhere(option) or did_you_mean(option, options)) if word.startswith("-") else ""
            self.error(f"unknown argument {word}{hint}")
        arguments.ros_args = ros_args
        return arguments

    def _refuse_recordings(self, arguments: argparse.Namespace) -> None:
        """Refuse a recording where a YAML file is expected."""
        for action in self._actions:
            if action.metavar in _YAML_FILES:
                value = getattr(arguments, action.dest)
                for word in [value] if isinstance(value, str) else value or []:
                    if holds_recording(word):
                        raise UsageError(f"{word} is a recording, expected a YAML file{for_recording(word)}")

    @property
    def actions(self) -> Sequence[argparse.Action]:
        """Return all options and positionals."""
        return self._actions

    def add_help_option(self) -> None:
        """Take -h and --help, as the last of the options."""
        self.add_argument("-h", "--help", action="store_true", help="print this help")

    def _split(self, words: Sequence[str]) -> tuple[Sequence[str], Sequence[str]]:
        if ROS_ARGS not in words or ROS_ARGS not in self._option_string_actions:
            return words, ()
        at = words.index(ROS_ARGS)
        return words[:at], words[at + 1 :]

    def refuse_repeated(self, files: Sequence[str]) -> None:
        """Refuse to read a file twice, whatever it is called; standard input can only be read once too."""
        named: dict[str, str] = {}
        for file in chain.from_iterable(map(yaml_files, files)):
            place = file if file == "-" else os.path.realpath(file)
            if place in named:
                first = named[place]
                same = f"{file} is named twice" if first == file else f"{first} and {file} are the same file"
                self.error(f"{same}: name each file once")
            named[place] = file


def positive(text: str) -> float:
    """Read a number of seconds above 0."""
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not number > 0:
        raise argparse.ArgumentTypeError(f"expected a number above 0, found {text}")
    if number > _MOST_S:
        raise argparse.ArgumentTypeError(f"expected a number of at most {_MOST_S}, found {text}")
    return number


def count(text: str) -> int:
    """Read a whole number above 0."""
    if not (text.isascii() and text.isdigit() and len(text) < _WIDTH and int(text)):
        raise argparse.ArgumentTypeError(f"expected a whole number above 0, found {text}")
    return int(text)


def seed(text: str) -> int:
    """Read a whole number of 0 or more."""
    try:
        return 0 if text == "0" else count(text)
    except argparse.ArgumentTypeError as error:
        raise argparse.ArgumentTypeError(f"expected a whole number of 0 or more, found {text}") from error


def duration(text: str) -> int:
    """Read a length of time above 0 with its unit, in nanoseconds."""
    from syncrelay.config.units import parse_duration_text

    try:
        length, _ = parse_duration_text(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    if length <= 0:
        raise argparse.ArgumentTypeError(f"expected a duration above 0, found {text}")
    return length


def add_what_if(parser: Parser) -> None:
    """Add the faults that are laid over a recording."""
    parser.add_repeatable(
        "--what-if",
        metavar="FAULT",
        help="lay a fault over the recording, such as 'late: TOPIC 80ms' or 'drop: TOPIC 10%% from 12s'; also offset,"
        " drift, dead",
    )
    parser.add_argument("--seed", metavar="N", type=seed, help="with --what-if: which messages are lost (0)")


def faults_of(parser: Parser, arguments: argparse.Namespace) -> tuple[tuple["Fault", ...], int]:
    """Return the faults that the arguments lay over a recording, and the seed of which messages are lost."""
    from syncrelay.rig.what_if import parse_fault

    try:
        faults = tuple(map(parse_fault, arguments.what_if))
    except ValueError as error:
        parser.error(f"argument --what-if: {error}")
    if arguments.seed is not None and not faults:
        parser.error("--seed goes with --what-if")
    return faults, arguments.seed or 0
