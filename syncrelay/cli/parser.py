"""argparse with our errors: one sentence, the nearest valid word, where to read on."""

import argparse
from collections.abc import Sequence
from typing import Any, NoReturn

from syncrelay.errors import UsageError


class Parser(argparse.ArgumentParser):
    """A parser that raises UsageError and never exits but for --help."""

    def __init__(self, prog: str, *, description: str, **options: Any) -> None:
        super().__init__(
            prog=prog,
            description=description,
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
            add_help=False,
            **options,
        )

    def error(self, message: str) -> NoReturn:
        """Raise UsageError with argparse's message."""
        raise UsageError(f"{message}\n  {self.prog} --help says more")

    def read(self, words: Sequence[str]) -> argparse.Namespace:
        """Return the arguments; an unknown one is an error with the nearest valid option."""
        arguments, unknown = self.parse_known_args(words)
        if unknown:
            from syncrelay.config.wording import did_you_mean

            word = unknown[0]
            options = [option for action in self._actions for option in action.option_strings]
            hint = did_you_mean(word.partition("=")[0], options) if word.startswith("-") else ""
            self.error(f"unknown argument {word}{hint}")
        return arguments
