"""What goes wrong between here and a server: what passes is tried again, the rest is told without a URL's secrets."""

import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, TypeVar

from syncrelay.errors import StorageError
from syncrelay.recording_files import scheme_of

_Done = TypeVar("_Done")
# A name and a password before the host; a password may hold a slash that should have been %2F.
_LOGIN: Final = re.compile(r"[^/?#]*@|[^/?#:\[]*:(?!\d*(?:[/?#]|$))[^?#]*@")
_HOW_LONG: Final = 60.0


class PassingError(Exception):
    """Something that may go right another time; its text says what, without the URL."""


class LastingError(Exception):
    """Something that stays as it is; its text says what, and what to do, without the URL."""


REPLACED: Final = "was replaced or removed while it was being read: read it again"


@dataclass(frozen=True, slots=True)
class Patience:
    """How often an answer is asked for, how long to wait before the second time, and how long one may take; seconds.

    Each wait is twice the one before.
    """

    attempts: int = 5
    first_wait: float = 0.3
    answer_within: float = _HOW_LONG


def redacted(word: str) -> str:
    """Return a URL without a name and password, and without the query that may sign it; any other word as it is."""
    scheme = scheme_of(word)
    if not scheme:
        return word
    rest = word[len(scheme) + 3 :]
    rest = rest[found.end() :] if (found := _LOGIN.match(rest)) else rest
    if scheme in ("http", "https"):
        plain = re.split(r"[?#]", rest, maxsplit=1)[0]
        rest = plain if plain == rest else f"{plain}?..."
    return f"{scheme}://{rest}"


def persist(name: str, work: Callable[[], _Done], patience: Patience) -> _Done:
    """Return what work gives, tried again while only what passes is wrong; raises StorageError that calls it `name`."""
    wait = patience.first_wait
    for left in reversed(range(patience.attempts)):
        try:
            return work()
        except LastingError as error:
            why = str(error)
            break
        except PassingError as error:
            why = f"{error} ({patience.attempts} attempts): try again later, or copy it here and read the copy"
        if left:
            time.sleep(wait)
            wait *= 2
    # Without what was caught: errors of the libraries quote the URL with its secrets, and tracebacks travel.
    raise StorageError(f"{name}: {why}") from None
