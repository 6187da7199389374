"""Messages as they were received, in columns: those of one input, and those of all inputs together."""

from collections.abc import Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain, repeat
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from syncrelay.clock import UNREADABLE
from syncrelay.explain.rows import Column, Numbers, blocks
from syncrelay.sync import Message

Places: TypeAlias = npt.NDArray[np.intp]

# So many messages of an input are merged with the others' at a time.
_AT_ONCE: Final = 10_000


class InOrder(NamedTuple):
    """An input's distinct stamps in order, offset added, the place of each message, and all places in order."""

    stamps: Column
    places: Column
    arrivals: Column


@dataclass(frozen=True, slots=True)
class Received:
    """One input's messages as they arrived: stamps, times of receipt, and their places among those of all inputs.

    Keys and frames are there for an engine that goes by them.
    """

    stamps: Column
    received: Column
    places: Column
    keys: Sequence[Hashable] | None = None
    frames: Sequence[str | None] | None = None
    ordered: dict[int, InOrder] = field(default_factory=dict)
    """What nearest.in_order gave, by the offset: all that compares inputs asks for it."""

    @property
    def are_stamped(self) -> npt.NDArray[np.bool_]:
        """Which messages have a stamp."""
        return _are_stamped(self.stamps[:])

    def stamped(self) -> Iterator[tuple[Numbers, Numbers, Numbers]]:
        """Yield stamps, times of receipt and places of those that have a stamp, many at a time."""
        for stamps, received, places in zip(*map(blocks, (self.stamps, self.received, self.places)), strict=True):
            is_set = _are_stamped(stamps)
            yield (stamps, received, places) if is_set.all() else (stamps[is_set], received[is_set], places[is_set])


def _are_stamped(stamps: Numbers) -> npt.NDArray[np.bool_]:
    stamped: npt.NDArray[np.bool_] = (stamps != 0) & (stamps != UNREADABLE)
    return stamped


class Messages(NamedTuple):
    """Messages of all inputs in the order of their receipt: stamps are UNREADABLE where there is none."""

    inputs: Numbers
    stamps: Numbers
    received: Numbers
    keys: Sequence[Hashable] | None = None
    frames: Sequence[str | None] | None = None

    def part(self, begin: int, end: int) -> "Messages":
        """Return some of them."""
        some = slice(begin, end)
        keys, frames = self.keys and self.keys[some], self.frames and self.frames[some]
        return Messages(self.inputs[some], self.stamps[some], self.received[some], keys, frames)

    def one_by_one(self) -> Iterator[Message]:
        """Yield what an engine takes; the payload is the time of receipt."""
        columns = (self.inputs.tolist(), self.stamps.tolist(), self.received.tolist())
        if self.keys is None and self.frames is None:
            return map(Message, *columns)
        beside: tuple[Any, Any] = (self.keys or repeat(None), self.frames or repeat(None))
        return map(Message, *columns, *beside)

    def by_input(self, n_inputs: int) -> tuple[Received, ...]:
        """Return those of each input, without keys and frames."""
        places = [np.flatnonzero(self.inputs == index) for index in range(n_inputs)]
        return tuple(Received(self.stamps[at], self.received[at], at) for at in places)


def as_arrays(messages: Sequence[Message], n_inputs: int) -> tuple[Received, ...]:
    """Return messages, in the order of receipt and with the time of receipt as payload, as arrays for each input."""
    columns = np.array([(each.input, each.stamp, each.payload) for each in messages], dtype=np.int64).reshape(-1, 3)
    return Messages(*columns.T).by_input(n_inputs)


def stretches(inputs: Sequence[Received]) -> Iterator[Messages]:
    """Yield the messages of all inputs by their places, some thousand at a time."""
    at = [0] * len(inputs)
    while any(begin < len(each.places) for begin, each in zip(at, inputs, strict=True)):
        ends = [begin + _AT_ONCE for begin in at]
        parts = [each.places[begin:end] for each, begin, end in zip(inputs, at, ends, strict=True)]
        # Up to here no later part has an earlier message.
        rest = [part[-1] for part, end, each in zip(parts, ends, inputs, strict=True) if end < len(each.places)]
        until = min(rest, default=None)
        counts = [len(part) if until is None else int(np.searchsorted(part, until, side="right")) for part in parts]
        among = [slice(begin, begin + count) for begin, count in zip(at, counts, strict=True)]
        yield _merged(inputs, among, [part[:count] for part, count in zip(parts, counts, strict=True)])
        at = [each.stop for each in among]


def first(messages: Iterable[Messages], count: int) -> Messages:
    """Return so many messages, or all, without keys and frames."""
    some = [np.zeros((3, 0), dtype=np.int64)]
    for each in messages:
        some.append(np.stack(each[:3]))
        count -= len(each.inputs)
        if count <= 0:
            break
    columns = np.concatenate(some, axis=1)
    return Messages(*columns[:, : columns.shape[1] + min(0, count)])


def _merged(inputs: Sequence[Received], among: Sequence[slice], places: Sequence[Numbers]) -> Messages:
    order, of = by_place(places)
    parts = list(zip(inputs, among, places, strict=True))
    return Messages(
        of,
        np.concatenate([each.stamps[some] for each, some, _ in parts])[order],
        np.concatenate([each.received[some] for each, some, _ in parts])[order],
        joined([(each.keys and each.keys[some], len(at)) for each, some, at in parts], order),
        joined([(each.frames and each.frames[some], len(at)) for each, some, at in parts], order),
    )


def by_place(places: Sequence[Places]) -> tuple[Places, Places]:
    """Return the order that sorts concatenated columns by place, and the column that each message then comes from.

    For equal places, the earlier column comes first.
    """
    order = np.argsort(np.concatenate(places), kind="stable")
    return order, np.repeat(np.arange(len(places)), [len(each) for each in places])[order]


def joined(columns: Iterable[tuple[Sequence[Any] | None, int]], order: Places) -> Sequence[Any] | None:
    """Concatenate and reorder columns, given with their lengths, of which some are None; None if all are."""
    columns = list(columns)
    if all(column is None for column, _ in columns):
        return None
    of_all = list(chain.from_iterable(repeat(None, length) if each is None else each for each, length in columns))
    return [of_all[at] for at in order.tolist()]
