"""The error that a faulty file raises."""

from collections.abc import Sequence

from syncrelay.config.problems import Problem
from syncrelay.config.render import render
from syncrelay.errors import SyncRelayError


class ConfigError(SyncRelayError):
    """A file that cannot be used, with everything that is wrong with it, in the order of the file."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        super().__init__(problems)
        self.problems = tuple(problems)

    def __str__(self) -> str:
        return render(self.problems)
