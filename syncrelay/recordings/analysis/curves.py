"""How many sets a group would give with other values: the engine is run with each of them, nothing is estimated."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from syncrelay.config import GroupConfig
from syncrelay.explain.changes import Change, changed
from syncrelay.explain.nearest import quantile
from syncrelay.explain.possible_sets import PossibleSets
from syncrelay.explain.received import first, stretches
from syncrelay.explain.trials import Trials
from syncrelay.recordings.analysis.streams import Stream, stamped
from syncrelay.sync.queues import LONGEST_QUEUE

MOST_MESSAGES: Final = 50_000
"""Of a longer recording, these first ones are used: some 20 runs of the engine on them take seconds."""
_SHARES: Final = (0.05, 0.25, 0.5, 0.75, 0.95, 1.0)
# Beyond the widest possible set more slop may still help: a queue may hold the second best partner only.
_WIDER: Final = (1.1, 1.5, 2)
_SIZES: Final = (1, 2, 5, 10, 20, 50, 100, 200, 500, LONGEST_QUEUE)


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
    group: GroupConfig, suggested: GroupConfig, streams: Sequence[Stream], *, most: int = MOST_MESSAGES
) -> Curves | None:
    """Return what a group gives with other values, with its own and with the suggested ones among them.

    Each slop is tried with the suggested queue_size, and each queue_size with the suggested slop. None where it is not
    known which messages belong together.
    """
    # Of what another policy needs, this one has the queue alone.
    base = suggested if suggested.options.policy == group.options.policy else changed(group, (_queue(suggested),))
    used = first(stretches([stream.as_received() for stream in stamped(base, streams)]), most)
    trials = Trials(base, used.by_input(len(streams)), is_window=False)
    possible, slop = trials.possible(), slop_key(group)
    if possible is None or group.options.matched_by:
        return None

    def points(option: str, values: set[int]) -> tuple[Point, ...]:
        values |= {getattr(each.options, option) for each in (group, suggested) if hasattr(each.options, option)}
        if len(values) == 1:
            return ()
        return tuple(_point(trials, option, value) for value in sorted(values))

    return Curves(
        by_slop=() if slop is None or possible.is_alone else points(slop, _slops(possible)),
        by_queue_size=points("queue_size", _sizes(group, suggested, possible)),
        messages=len(used.inputs),
        recorded=sum(len(stream.places) for stream in streams),
        lasts=int(used.received[-1] - used.received[0]) if len(used.inputs) else 0,
        of=int(np.count_nonzero(used.inputs == possible.pivot)),
    )


def slop_key(group: GroupConfig) -> str | None:
    """Return the key of the file that says how wide a group's sets may be, None where it has none."""
    tolerance = group.options.tolerance
    return tolerance.key if tolerance is not None and tolerance.is_key else None


def _queue(group: GroupConfig) -> Change:
    return Change("queue_size", str(group.options.queue_size))


def _point(trials: Trials, option: str, value: int) -> Point:
    written = str(value) if option == "queue_size" else f"{value}ns"
    spans = trials.spans_given((Change(option, written),))
    return Point(value, len(spans), quantile(spans, 0.5) if len(spans) else 0)


def _slops(possible: PossibleSets) -> set[int]:
    """Return slops that give ever more of the possible sets, and some that are wider than the widest of them."""
    if not len(possible):
        return set()
    return {
        *(quantile(possible.spans, share) for share in _SHARES),
        *(round(factor * possible.widest) for factor in _WIDER),
    }


def _sizes(group: GroupConfig, suggested: GroupConfig, possible: PossibleSets) -> set[int]:
    """Return queue sizes up to twice what is in use, suggested or needed by nearly all of the possible sets."""
    needed = quantile(possible.queues, 0.99) if len(possible) else 1
    most = 2 * max(needed, group.options.queue_size, suggested.options.queue_size)
    return {size for size in _SIZES if size <= most}
