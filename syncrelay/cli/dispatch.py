"""The commands, and the way from the words of the command line to one of them. Each command's file owns its parser."""

from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Final, NamedTuple

from syncrelay.cli.boundary import DONE, USAGE, put, say
from syncrelay.cli.parser import HelpRequested
from syncrelay.cli.stop import StopRequest
from syncrelay.errors import UsageError


class _Command(NamedTuple):
    """A command: how it is called, what it does, and the module whose `command` runs it."""

    usage: str
    does: str
    module: str


_COMMANDS: Final = {
    each.usage.split()[0]: each
    for each in (
        _Command("validate FILE...", "check files; show every error at its line", "validate"),
        _Command("init --from-bag BAG", "propose a file for a recording, or for a live graph", "init"),
        _Command("analyze BAG", "measure a recording, and suggest values that fit it", "analyze"),
        _Command("replay BAG...", "run a file's groups on a recording, without ROS", "replay"),
        _Command("demo", "try it on simulated sensors; needs no robot", "demo"),
        _Command("doctor", "find out why messages may not arrive", "doctor"),
        _Command("top", "watch a running relay, here or on another machine", "top"),
        _Command("reload", "make a running relay read its file again", "reload"),
        _Command("healthcheck", "check that the relay is receiving", "heartbeat"),
        _Command("schema", "print the JSON Schema of the file, for editors", "schema"),
    )
}
_RELAY: Final = "run"


def dispatch(words: Sequence[str], *, stop: StopRequest) -> int:
    """Run what the command line asks for and return its exit code; raises UsageError where it makes no sense."""
    try:
        if not words or words[0].startswith("-"):
            return _command(_RELAY)(words or ["--help"], stop)
        first, *rest = words
        if first == "help":
            return _command(_RELAY)(["--help"], stop)
        if first not in _COMMANDS:
            raise UsageError(_unknown_command(first))
        return _command(_COMMANDS[first].module)(rest, stop)
    except HelpRequested as help_requested:
        tell, code = (put, DONE) if words else (say, USAGE)
        tell(str(help_requested).rstrip("\n"))
        return code


def _command(module: str) -> Callable[[Sequence[str], StopRequest], int]:
    """Import a command only when it is to run: some need a second for what they import."""
    command: Callable[[Sequence[str], StopRequest], int] = import_module(f"syncrelay.cli.{module}").command
    return command


def commands_help() -> str:
    """Return a line for each command."""
    return "\n".join(f"  {each.usage:<21}{each.does}" for each in _COMMANDS.values())


def _unknown_command(word: str) -> str:
    from syncrelay.config.wording import did_you_mean

    if word.endswith((".yaml", ".yml")) or Path(word).is_file():
        return (
            f"{word} is not a command\n  syncrelay --config {word}     to run the relay with it\n"
            f"  syncrelay validate {word}     to check it"
        )
    return f"unknown command {word}{did_you_mean(word, _COMMANDS)}\n  syncrelay --help lists the commands"
