"""How many sets a group would give with other values: the engine is run with each of them, nothing is estimated."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Final

import numpy as np

from syncrelay.config import GroupConfig
from syncrelay.explain import dry_run
from syncrelay.recordings.analysis.evaluation import completed
from syncrelay.recordings.analysis.nearest import PossibleSets
from syncrelay.recordings.analysis.streams import Stream, messages
from syncrelay.sync import Message

MOST_MESSAGES: Final = 50_000
"""Of a longer recording, these first ones are used: some 20 runs of the engine on them take seconds."""
LARGEST_QUEUE: Final = 1000
"""Longer queues are neither tried nor suggested."""

_SHARES: Final = (0.05, 0.25, 0.5, 0.75, 0.95, 1.0)
# Beyond the widest possible set more slop may still help: a queue may hold the second best partner only.
_WIDER: Final = (1.1, 1.5, 2)
_SIZES: Final = (1, 2, 5, 10, 20, 50, 100, 200, 500, LARGEST_QUEUE)


@dataclass(frozen=True, slots=True)
class Point:
    """A value, nanoseconds or messages, how many sets come together with it, and their median span."""

    value: int
    sets: int
    median_span: int


@dataclass(frozen=True, slots=True)
class Curves:
    """What other values of slop and queue_size would give; no points where there is nothing to compare.

    They are of the first `messages` of the `recorded` ones of the group's inputs, received within `lasts` nanoseconds;
    `of` counts those of the slowest input, of which each can be in one set.
    """

    by_slop: tuple[Point, ...]
    by_queue_size: tuple[Point, ...]
    messages: int
    recorded: int
    lasts: int
    of: int

    @property
    def is_of_all(self) -> bool:
        """Whether all messages were used."""
        return self.messages == self.recorded


def curves_of(
    group: GroupConfig,
    suggested: GroupConfig,
    streams: Sequence[Stream],
    possible: PossibleSets,
    *,
    most: int = MOST_MESSAGES,
) -> Curves:
    """Return what a group gives with other values, with its own and with the suggested ones among them."""
    used = list(islice(messages(streams), most))
    pivot, slop = possible.tightest.pivot, slop_key(group)

    def points(option: str, values: set[int]) -> tuple[Point, ...]:
        values |= {getattr(each.options, option) for each in (group, suggested) if hasattr(each.options, option)}
        if len(values) == 1:
            return ()
        return tuple(_point(group, option, value, used, pivot) for value in sorted(values))

    return Curves(
        by_slop=() if slop is None or possible.is_alone else points(slop, _slops(possible)),
        by_queue_size=points("queue_size", _sizes(group, suggested, possible)),
        messages=len(used),
        recorded=sum(len(stream.places) for stream in streams),
        lasts=used[-1].payload - used[0].payload if used else 0,
        of=sum(message.input == pivot for message in used),
    )


def slop_key(group: GroupConfig) -> str | None:
    """Return the key of the file that says how wide a group's sets may be, None where it has none."""
    tolerance = group.options.tolerance
    return tolerance.key if tolerance is not None and tolerance.is_key else None


def _point(group: GroupConfig, option: str, value: int, used: Sequence[Message], pivot: int) -> Point:
    tried = replace(group, options=group.options.model_copy(update={option: value}))
    run = dry_run(tried, used)
    span = int(np.quantile(run.spans, 0.5, method="inverted_cdf")) if run.spans else 0
    return Point(value, completed(run.counts, pivot), span)


def _slops(possible: PossibleSets) -> set[int]:
    """Return slops that give ever more of the possible sets, and some that are wider than the widest of them."""
    if not possible.spans:
        return set()
    narrow = np.quantile(possible.spans, _SHARES, method="inverted_cdf").tolist()
    return {*narrow, *(round(factor * possible.widest) for factor in _WIDER)}


def _sizes(group: GroupConfig, suggested: GroupConfig, possible: PossibleSets) -> set[int]:
    """Return queue sizes up to twice what is in use, suggested or needed by nearly all of the possible sets."""
    found = possible.tightest
    queues = found.queues[found.spans <= possible.widest]
    needed = int(np.quantile(queues, 0.99, method="inverted_cdf")) if len(queues) else 1
    most = 2 * max(needed, group.options.queue_size, suggested.options.queue_size)
    return {size for size in _SIZES if size <= most}
