"""The commands, and the way from the words of the command line to one of them. Each has a file for its work."""

import os
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

from syncrelay.cli import parsers, recording_parsers
from syncrelay.cli.boundary import DONE, USAGE, put, say
from syncrelay.cli.parser import HelpRequested, Parser, for_recording
from syncrelay.cli.stop import StopRequest
from syncrelay.collector import resting_collector
from syncrelay.errors import UsageError
from syncrelay.recording_files import holds_recording

if TYPE_CHECKING:
    from argparse import Namespace


class Command(NamedTuple):
    """A command: how it is called, what it does, its parser, and the module whose `command` runs it."""

    usage: str
    does: str
    parser: Callable[[], Parser]
    module: str


COMMANDS: Final = {
    each.usage.split()[0]: each
    for each in (
        Command("validate FILE...", "check files; show every error at its line", parsers.validate, "validate"),
        Command("diff OLD NEW", "say what a reload to another file would do", parsers.diff, "diff"),
        Command("graph FILE...", "draw the groups of files: Mermaid, DOT or SVG", parsers.graph, "graph"),
        Command("init --from-bag BAG", "propose a file for a recording, or for a live graph", parsers.init, "init"),
        Command(
            "analyze BAG...", "measure recordings, and suggest values that fit", recording_parsers.analyze, "analyze"
        ),
        Command("replay BAG...", "run a file's groups on a recording, without ROS", recording_parsers.replay, "replay"),
        Command(
            "export BAG...", "write the matched sets of recordings as datasets", recording_parsers.export, "export"
        ),
        Command("test FILE...", "run the tests of a configuration, without ROS", parsers.test, "test"),
        Command("demo", "try it on simulated sensors; needs no robot", parsers.demo, "demo"),
        Command("doctor", "find out why messages may not arrive", parsers.doctor, "doctor"),
        Command("observe", "try a file beside a running robot; publishes nothing", parsers.observe, "observe"),
        Command("top", "watch a running relay, here or on another machine", parsers.top, "top"),
        Command("tap [GROUP]", "print each set and drop of a running relay", parsers.tap, "tap"),
        Command("reload", "make a running relay read its file again", parsers.reload, "reload"),
        Command("healthcheck", "check that the relay is receiving", parsers.healthcheck, "heartbeat"),
        Command("schema", "print the JSON Schema of the file, for editors", parsers.schema, "schema"),
        Command("completion SHELL", "print a script for bash, zsh or fish", parsers.completion, "completion"),
    )
}
_RELAY: Final = "run"
COMPLETES: Final = "_ARGCOMPLETE"
"""The environment variable by which a shell's script asks for completion."""


def dispatch(words: Sequence[str], *, stop: StopRequest) -> int:
    """Run what the command line asks for and return its exit code; raises UsageError where it makes no sense."""
    if not words and {COMPLETES, "COMP_LINE"} <= os.environ.keys():
        from syncrelay.cli.completion import complete

        return complete()
    try:
        if not words or words[0].startswith("-"):
            return _run(parsers.relay(), _RELAY, words or ["--help"], stop)
        first, *rest = words
        if first == "help":
            return _run(parsers.relay(), _RELAY, ["--help"], stop)
        if first not in COMMANDS:
            raise UsageError(_unknown_command(first))
        return _run(COMMANDS[first].parser(), COMMANDS[first].module, rest, stop)
    except HelpRequested as help_requested:
        tell, code = (put, DONE) if words else (say, USAGE)
        tell(str(help_requested).rstrip("\n"))
        return code


def _run(parser: Parser, module: str, words: Sequence[str], stop: StopRequest) -> int:
    """Read the words, and import the command only when it is to run: some need a second for what they import."""
    arguments = parser.read(words)
    command: Callable[[Parser, Namespace, StopRequest], int]
    with resting_collector():
        command = import_module(f"syncrelay.cli.{module}").command
    return command(parser, arguments, stop)


def commands_help() -> str:
    """Return a line for each command."""
    return "\n".join(f"  {each.usage:<21}{each.does}" for each in COMMANDS.values())


def _unknown_command(word: str) -> str:
    from syncrelay.config.wording import did_you_mean

    if holds_recording(word):
        return f"{word} is a recording, not a command{for_recording(word)}"
    if word.endswith((".yaml", ".yml")) or Path(word).exists():
        return (
            f"{word} is not a command\n  syncrelay --config {word}     to run the relay with it\n"
            f"  syncrelay validate {word}     to check it"
        )
    return f"unknown command {word}{did_you_mean(word, COMMANDS)}\n  syncrelay --help lists the commands"
