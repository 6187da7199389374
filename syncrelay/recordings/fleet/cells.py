"""Sums by a key, of which there may be more than anyone can tell apart."""

from collections.abc import Callable, Hashable, Iterator
from typing import Final, Generic, Protocol, Self, TypeVar

MOST_ROWS: Final = 5000
"""More robots, topics or days are not told apart."""


class Addable(Protocol):
    """What takes another of its kind into itself."""

    def add(self, other: Self) -> None:
        """Add the other's counts to the own."""
        ...


Key = TypeVar("Key", bound=Hashable)
Cell = TypeVar("Cell", bound=Addable)


class Cells(Generic[Key, Cell]):
    """A sum for each key, which begins as `empty` gives it; none at all once there are more than `most` keys."""

    def __init__(self, empty: Callable[[], Cell], most: int = MOST_ROWS) -> None:
        self._empty = empty
        self._most = most
        self._cells: dict[Key, Cell] | None = {}

    @property
    def is_told(self) -> bool:
        """Whether there are no more keys than can be told apart."""
        return self._cells is not None

    def items(self) -> Iterator[tuple[Key, Cell]]:
        """Yield the keys and their sums."""
        yield from (self._cells or {}).items()

    def put(self, key: Key, cell: Cell) -> None:
        """Add to the sum of a key."""
        if self._cells is None:
            return
        if key not in self._cells:
            if len(self._cells) == self._most:
                self._cells = None
                return
            self._cells[key] = self._empty()
        self._cells[key].add(cell)

    def add(self, other: Self) -> None:
        """Add the sums of another one."""
        if other._cells is None:
            self._cells = None
        for key, cell in other.items():
            self.put(key, cell)
