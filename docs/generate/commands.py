"""The commands and their options as their page shows them."""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from docs.generate.markdown import plain
from syncrelay.cli import run
from syncrelay.cli.boundary import EXIT_CODES
from syncrelay.cli.commands import COMMANDS, Need
from syncrelay.cli.parser import Parser

_WIDTH = 100


@dataclass(frozen=True, slots=True)
class _Option:
    name: str
    meaning: str


@dataclass(frozen=True, slots=True)
class _Command:
    name: str
    meaning: str
    usage: str
    options: Sequence[_Option]
    needs: Sequence[Need] = ()


def relay() -> _Command:
    """Return the relay, which is no command."""
    return _command(run.parser())


def the_commands() -> Iterator[_Command]:
    """Yield all commands, in the order of the help."""
    for command in COMMANDS.values():
        yield _command(command.parser(), command.needs)


def exit_codes() -> Mapping[int, str]:
    """Return what each exit code means."""
    return EXIT_CODES


def _command(parser: Parser, needs: Sequence[Need] = ()) -> _Command:
    return _Command(
        parser.prog,
        plain(" ".join((parser.description or "").split())),
        _usage(parser),
        tuple(_Option(_name(action), plain((action.help or "").replace("%%", "%"))) for action in parser.actions),
        needs,
    )


def _name(action: argparse.Action) -> str:
    return ", ".join(f"{option}{_value(action)}" for option in action.option_strings) or str(action.metavar)


def _value(action: argparse.Action) -> str:
    return f" {action.metavar}" if action.metavar and action.nargs != 0 else ""


def _usage(parser: Parser) -> str:
    """Return the words of a command, in lines that do not run off a page."""
    lines = [parser.prog]
    for word in _words(parser):
        if len(lines[-1]) + len(word) >= _WIDTH:
            lines.append("   ")
        lines[-1] += f" {word}"
    return "\n".join(lines)


def _words(parser: Parser) -> Iterator[str]:
    # argparse says nowhere else what excludes what.
    exclusive = [group._group_actions for group in parser._mutually_exclusive_groups]  # noqa: SLF001
    for action in parser.actions:
        group = next((each for each in exclusive if action in each), None)
        if group is None:
            yield _word(action)
        elif action is group[0]:
            yield f"({' | '.join(each.option_strings[0] + _value(each) for each in group)})"


def _word(action: argparse.Action) -> str:
    if not action.option_strings:
        name = str(action.metavar)
        return {"+": f"{name}...", "*": f"[{name}...]", "?": f"[{name}]"}.get(str(action.nargs), name)
    word = action.option_strings[0] + _value(action)
    if isinstance(action, argparse._AppendAction):  # noqa: SLF001  it has no other name
        return f"{word}..." if action.required else f"[{word}]..."
    return word if action.required else f"[{word}]"
