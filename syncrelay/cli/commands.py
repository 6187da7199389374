"""The commands, each with a module of its name, and the extras that they need. Imports nothing slow.

The module of a command has its `parser()`, which completion asks at every press of TAB, and its `command`, which does
the work and imports what that takes.
"""

from argparse import Namespace
from collections.abc import Callable, Mapping
from importlib import import_module
from importlib.util import find_spec
from typing import Final, NamedTuple

from syncrelay.cli.parser import Parser
from syncrelay.errors import UnavailableError

EXTRAS: Final[Mapping[str, tuple[str, ...]]] = {
    "recordings": ("jinja2", "lz4", "mcap", "rich", "rosbags", "ruamel.yaml", "small_mcap", "xxhash", "zstandard"),
    "datasets": ("PIL", "av", "isal", "pyarrow"),
    "fleet": ("ray",),
    "top": ("rich", "textual"),
}
"""The packages that an extra of pyproject.toml brings, as they are imported."""


class Need(NamedTuple):
    """An extra that a command needs: always, or `when` it `applies`, which is said in words for the reference."""

    extra: str
    when: str = ""
    applies: Callable[[Namespace], bool] = lambda _: True


class Command(NamedTuple):
    """A command: how it is called, what it does, the extras that it needs."""

    usage: str
    does: str
    needs: tuple[Need, ...] = ()
    works_on: str = ""
    """What it is for, under which it stands in the first help; empty for those that only the whole help names."""

    @property
    def name(self) -> str:
        """The word that calls it, and the name of its module."""
        return self.usage.split()[0]

    def parser(self) -> Parser:
        """Return the parser of its words."""
        parser: Parser = import_module(f"syncrelay.cli.{self.name}").parser()
        return parser


_FILE: Final = "a file"
_BAGS: Final = "recordings"
_ROBOT: Final = "a robot"
_RECORDINGS: Final = Need("recordings")
_TO_DRAW: Final = Need("top", "to draw on a terminal, where it prints text otherwise", lambda _: False)
_RAY: Final = Need("fleet", "for `--engine ray`", lambda arguments: arguments.engine == "ray")

COMMANDS: Final[Mapping[str, Command]] = {
    each.name: each
    for each in (
        Command("validate FILE...", "check files; show every error at its line", works_on=_FILE),
        Command("diff OLD NEW", "say what a reload to another file would do", works_on=_FILE),
        Command("graph FILE...", "draw the groups of files as Mermaid or text", works_on=_FILE),
        Command("interfaces FILE...", "write messages that hold the sets of files"),
        Command(
            "init --from-bag BAG", "propose a file for a recording, or for a live graph", (_RECORDINGS,), works_on=_BAGS
        ),
        Command("analyze BAG...", "measure recordings, and suggest values that fit", (_RECORDINGS,), works_on=_BAGS),
        Command("replay BAG...", "run a file's groups on a recording, without ROS", (_RECORDINGS,), works_on=_BAGS),
        Command(
            "export BAG...",
            "write the matched sets of recordings as datasets",
            (
                _RECORDINGS,
                Need("datasets", "for `--format parquet` and `lerobot`", lambda given: given.format != "mcap"),
                _RAY,
            ),
            works_on=_BAGS,
        ),
        Command(
            "fleet COMMAND BAG...",
            "analyze or replay many recordings, each by itself",
            (_RECORDINGS, Need("datasets", "for `analyze`", lambda arguments: arguments.does == "analyze"), _RAY),
            works_on=_BAGS,
        ),
        Command("test FILE...", "run the tests of a configuration, without ROS", (_RECORDINGS,), works_on=_FILE),
        Command(
            "demo",
            "try it on simulated sensors; needs no robot",
            (Need("recordings", "for `--record`", lambda arguments: arguments.record is not None), _TO_DRAW),
        ),
        Command("doctor", "find out why messages may not arrive", works_on=_ROBOT),
        Command(
            "observe", "try a file beside a running robot; publishes nothing", (_RECORDINGS, _TO_DRAW), works_on=_ROBOT
        ),
        Command(
            "top",
            "watch a running relay, here or on another machine",
            (Need("top", "unless `--once` is given", lambda arguments: not arguments.once),),
            works_on=_ROBOT,
        ),
        Command("tap [GROUP]", "print each set and drop of a running relay", works_on=_ROBOT),
        Command("reload", "make a running relay read its file again", works_on=_ROBOT),
        Command("healthcheck", "check that the relay is receiving"),
        Command(
            "schema",
            "print the JSON Schema of the file, for editors",
            (Need("recordings", "for `--test`", lambda arguments: arguments.test),),
        ),
        Command("completion SHELL", "print a script for bash, zsh or fish"),
    )
}


def commands_help(*, are_all: bool) -> str:
    """Return a line for each command, under what it is for; of the others only if they are `all`."""
    by_use: dict[str, list[str]] = {use: [] for use in (_FILE, _BAGS, _ROBOT, "")}
    for each in COMMANDS.values():
        by_use[each.works_on].append(f"  {each.usage:<21}{each.does}")
    others = by_use.pop("")
    parts = [f"for {use}:\n{chr(10).join(lines)}" for use, lines in by_use.items()]
    last = (
        "\n".join(["others:", *others]) if are_all else "new here: syncrelay demo; all commands: syncrelay --help --all"
    )
    return "\n".join([*parts, last])


def commands_with(option: str) -> str:
    """Return which commands have an option, as the end of an error; empty if none has."""
    from syncrelay.config.wording import all_of

    options = {name: [each.option_strings for each in of.parser().actions] for name, of in COMMANDS.items()}
    named = [f"`{name}`" for name, known in options.items() if any(option in strings for strings in known)]
    return f": that is an option of {all_of(named)}" if named else ""


def require_extras(command: Command, arguments: Namespace) -> None:
    """Raise UnavailableError where what the command needs for these words is not installed. Imports none of it."""
    missing = {each.extra: _missing(each.extra) for each in command.needs if each.applies(arguments)}
    if packages := [package for of_extra in missing.values() for package in of_extra]:
        line = line_to_install(",".join(extra for extra, of_extra in missing.items() if of_extra))
        named = ", ".join(packages)
        raise UnavailableError(f"{command.name} needs Python packages that are not installed: {named}\n  {line}")


def line_to_install(extras: str) -> str:
    """Return what to type for extras, which are separated by commas; for none, what installs the rest."""
    with_extras = f"[{extras}]" if extras else ""
    return f"pip install 'syncrelay{with_extras}'     (in a clone: pip install '.{with_extras}')"


def is_installed(extra: str) -> bool:
    """Tell whether the packages of an extra are there."""
    return not _missing(extra)


def _missing(extra: str) -> list[str]:
    return [package for package in EXTRAS[extra] if not _is_there(package)]


def _is_there(module: str) -> bool:
    try:
        return find_spec(module) is not None
    except ModuleNotFoundError:
        # What it is a part of is missing.
        return False
