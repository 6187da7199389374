"""Exceptions that should not be: told once, with their traceback, and nothing ends for them."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

_LOG = logging.getLogger("syncrelay")

# What fails in ever new words is told no more than so often.
_MOST: Final = 100


class Bugs:
    """Keeps the parts of the relay's work apart. Any thread."""

    def __init__(self) -> None:
        self._told: set[tuple[str, str]] = set()

    @contextmanager
    def contained(self, what: str) -> Iterator[None]:
        """Go on after a part of the work that fails; `what` it is, as a sentence says it after "while"."""
        try:
            yield
        except Exception as error:  # noqa: BLE001  told, and nothing else depends on it
            self.tell(what, error)

    def tell(self, what: str, error: Exception) -> None:
        """Log it, the first time."""
        key = (what, repr(error))
        if key not in self._told and len(self._told) < _MOST:
            self._told.add(key)
            _LOG.error(
                "a bug in syncrelay while %s; the relay goes on. Please report it with these lines and your file",
                what,
                exc_info=error,
            )
