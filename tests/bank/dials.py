"""What is said of a draw by one number of it."""

from collections.abc import Callable
from typing import Any, NamedTuple


class Dial(NamedTuple):
    """A number of a draw: how it is called, what is said by it, what it is, and another that it may be."""

    what: str
    said: Callable[[Any], Any]
    low: Any
    high: Any
