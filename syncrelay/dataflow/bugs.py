"""What is logged once: a line that would repeat, and an unexpected exception, after which the relay keeps running."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

_LOG = logging.getLogger("syncrelay")

# An error whose text differs each time is logged at most this often.
_MOST: Final = 100


class OnceLog:
    """Logs each text the first time that it is given."""

    def __init__(self) -> None:
        self._logged: set[str] = set()

    def log(self, level: int, text: str) -> None:
        """Log a text at a level of `logging`, if it is new."""
        if text not in self._logged:
            self._logged.add(text)
            _LOG.log(level, "%s", text)


class Bugs:
    """Keeps the parts of the relay's work apart. Any thread."""

    def __init__(self) -> None:
        self._logged: set[tuple[str, str]] = set()

    @contextmanager
    def contained(self, what: str) -> Iterator[None]:
        """Log an exception in a part of the work, and go on; `what` completes "a bug in syncrelay while"."""
        try:
            yield
        except Exception as error:  # noqa: BLE001  it is logged, and nothing else depends on it
            self.log(what, error)

    def log(self, what: str, error: Exception) -> None:
        """Log an exception, the first time that it comes."""
        key = (what, repr(error))
        if key not in self._logged and len(self._logged) < _MOST:
            self._logged.add(key)
            _LOG.error(
                "a bug in syncrelay while %s; the relay keeps running. Please report it with these lines and your file",
                what,
                exc_info=error,
            )
