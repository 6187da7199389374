"""Values that were suggested for recordings, and what they would give."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Final, Self

from syncrelay.recordings.fleet.cells import Cells
from syncrelay.recordings.fleet.documents import Group

# More are no help.
_MOST_VALUES: Final = 1000


@dataclass(frozen=True, slots=True, order=True)
class Where:
    """A group, and one of its topics; the empty text where it is about none of them alone."""

    group: str
    topic: str


@dataclass(frozen=True, slots=True, order=True)
class Value:
    """A key of a group, or of one of its topics, and a value as it stands in a file."""

    where: Where
    key: str
    value: str

    @property
    def written(self) -> str:
        """As it stands in a file."""
        return f"{self.key}: {self.value}"


@dataclass(frozen=True, slots=True)
class Gain:
    """What recordings give `now` and would give `then`, of `possible` sets, each with all that was suggested for it."""

    recordings: int
    now: int
    then: int
    possible: int


@dataclass(frozen=True, slots=True)
class Suggested:
    """A value, and the recordings that it was suggested for."""

    value: Value
    gain: Gain


@dataclass(slots=True)
class _Gained:
    recordings: int = 0
    now: int = 0
    then: int = 0
    possible: int = 0

    def add(self, other: Self) -> None:
        self.recordings += other.recordings
        self.now += other.now
        self.then += other.then
        self.possible += other.possible

    def gain(self) -> Gain:
        return Gain(self.recordings, self.now, self.then, self.possible)


def values_of(group: Group) -> frozenset[Value]:
    """Return the values that were suggested for a group of a recording."""
    return frozenset(
        Value(Where(group.name, group.topic_of(each.topic) or ""), each.key, str(each.value))
        for each in group.suggestion.changes
    )


class Values:
    """The values that were suggested for recordings, as they come."""

    __slots__ = ("_all", "_each")

    def __init__(self) -> None:
        self._each: Cells[Value, _Gained] = Cells(_Gained, _MOST_VALUES)
        self._all = _Gained()

    def count(self, values: Collection[Value], group: Group) -> None:
        """Count values that were suggested for a group of a recording; a recording counts once, whatever its groups."""
        if not values:
            return
        found = group.suggestion
        self._all.add(_Gained(1 - self._all.recordings, found.now, found.then, found.possible))
        for value in values:
            self._each.put(value, _Gained(1, found.now, found.then, found.possible))

    def add(self, other: Self) -> None:
        """Add those of other recordings."""
        self._all.add(other._all)
        self._each.add(other._each)

    @property
    def is_told(self) -> bool:
        """Whether there are no more than can be told apart."""
        return self._each.is_told

    def gain(self) -> Gain:
        """Return what all of them give."""
        return self._all.gain()

    def suggested(self) -> tuple[Suggested, ...]:
        """Return each value, those for most recordings first."""
        rows = [Suggested(value, gained.gain()) for value, gained in self._each.items()]
        return tuple(sorted(rows, key=lambda each: (-each.gain.recordings, each.value)))
