"""The way from the words of the command line to a command."""

import os
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from syncrelay.cli.boundary import DONE, USAGE, put, say
from syncrelay.cli.commands import COMMANDS, commands_with, require_extras
from syncrelay.cli.parser import HelpRequested, Parser, for_recording
from syncrelay.cli.stop import StopRequest
from syncrelay.errors import UsageError
from syncrelay.recording_files import holds_recording

if TYPE_CHECKING:
    from argparse import Namespace


def dispatch(words: Sequence[str], *, stop: StopRequest) -> int:
    """Run what the command line asks for and return its exit code; raises UsageError where it makes no sense."""
    if not words and {"_ARGCOMPLETE", "COMP_LINE"} <= os.environ.keys():
        from syncrelay.cli.completion import complete

        return complete()
    try:
        if words[:1] == ["help"]:
            words = ["--help", *words[1:]]
        if "--all" in words and words[0] in ("-h", "--help", "--all") and {"-h", "--help"} & {*words}:
            from syncrelay.cli.run import parser

            return _run("run", ["--help"], stop, parser(with_all_commands=True))
        if not words or words[0].startswith("-"):
            return _run("run", words or ["--help"], stop)
        first, *rest = words
        if first not in COMMANDS:
            raise UsageError(_unknown_command(first))
        return _run(first, rest, stop)
    except HelpRequested as help_requested:
        tell, code = (put, DONE) if words else (say, USAGE)
        tell(str(help_requested).rstrip("\n"))
        return code


def _run(name: str, words: Sequence[str], stop: StopRequest, parser: "Parser | None" = None) -> int:
    """Read the words, check that what they need is installed, and run the module of this name."""
    module = import_module(f"syncrelay.cli.{name}")
    parser = parser or module.parser()
    arguments = parser.read(words, elsewhere=commands_with)
    if name in COMMANDS:
        require_extras(COMMANDS[name], arguments)
    command: Callable[[Parser, Namespace, StopRequest], int] = module.command
    return command(parser, arguments, stop)


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
