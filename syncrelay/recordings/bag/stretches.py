"""A long recording in stretches that can be replayed side by side, with the sets of one pass.

docs/explanation/stretches.md says why they are the same.
"""

from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final, TypeAlias

from syncrelay.recordings.bag.bindings import GroupBinding
from syncrelay.recordings.bag.recording import AFTER_ALL, Recording
from syncrelay.recordings.bag.replay import GroupResult, InputResult
from syncrelay.sync import DropReason, InputCounts

# An end that lies asks for more than there are messages. Names of files have four digits for them.
_MOST_STRETCHES: Final = 9_999
# Of inputs that send more seldom, more than one message should come; of queues that are full, all.
_LEAST_LEAD_NS: Final = 10_000_000_000
_LEAD_PER_PLACE_NS: Final = 100_000_000


@dataclass(frozen=True, slots=True)
class Stretch:
    """What was received from `begin` to before `end`.

    To be in the midst of it at `begin`, two parts are fed before: the recording's opening, up to before `opening_end`,
    for what a group keeps from its first set or message on; and the lead-in, from `read_from` on.
    """

    begin: int
    end: int
    read_from: int
    opening_end: int = 0

    @property
    def is_last(self) -> bool:
        """Whether nothing can come after it."""
        return self.end >= AFTER_ALL


@dataclass(frozen=True, slots=True)
class GroupStretch:
    """What a group made of a stretch: its states at both ends, what became of the messages, its engine at the end.

    The counts are those of what happened within the stretch; `buffered` is at its end.
    """

    entry: Hashable
    exit: Hashable
    result: GroupResult
    engine: bytes


@dataclass(frozen=True, slots=True)
class StretchResult:
    """What the groups made of a stretch; can be pickled."""

    stretch: Stretch
    groups: tuple[GroupStretch, ...]

    def follows(self, before: "StretchResult") -> bool:
        """Tell whether this is what one pass would have made of the stretch, if `before` is of the one before it.

        It is where the engines were in the very state in which those before had ended.
        """
        states = [each.exit for each in before.groups]
        return before.stretch.end == self.stretch.begin and [each.entry for each in self.groups] == states

    def without_engines(self) -> "StretchResult":
        """Return the same, with nothing left to go on from: an engine has all bytes of the messages that it holds."""
        return replace(self, groups=tuple(replace(each, engine=b"") for each in self.groups))


Again: TypeAlias = Callable[[Stretch, StretchResult], StretchResult]
"""Replays a stretch once more, going on from the end of the one before."""


def lead_in(bindings: Iterable[GroupBinding]) -> int:
    """Return for how many nanoseconds groups should be fed before a stretch, to be in the state of one pass.

    That is for how long they hold messages, as far as the file tells. Too little costs time, never a set.
    """
    leads = [_LEAST_LEAD_NS]
    for binding in bindings:
        options = binding.group.options
        tolerance = max(topic.tolerance.ns if topic.tolerance else 0 for topic in binding.group.topics)
        held = 2 * ((options.max_wait or 0) + tolerance) + options.queue_size * _LEAD_PER_PLACE_NS
        leads.append(_LEAST_LEAD_NS + held)
    return max(leads)


def cut(recording: Recording, *, length_ns: int, lead_in_ns: int) -> tuple[Stretch, ...]:
    """Return stretches of equal length, `length_ns` at most, that together are all of a recording.

    `lead_in_ns` is the length of the lead-in and of the opening.
    """
    if length_ns < 1 or lead_in_ns < 0:
        raise ValueError(f"length_ns {length_ns} must be 1 or more, lead_in_ns {lead_in_ns} 0 or more")
    span = recording.end - recording.begin
    count = min(max(1, -(-span // length_ns)), _MOST_STRETCHES)
    borders = [recording.begin + span * number // count for number in range(1, count)]
    return cut_at(borders, lead_in_ns=lead_in_ns, opening_end=recording.begin + lead_in_ns)


def cut_at(borders: Iterable[int], *, lead_in_ns: int, opening_end: int = 0) -> tuple[Stretch, ...]:
    """Return the stretches that times of receipt cut a recording into, none of them after its end."""
    begins = sorted({0, *borders})
    return tuple(
        Stretch(begin, end, max(0, begin - lead_in_ns), opening_end) for begin, end in pairwise([*begins, AFTER_ALL])
    )


def settled(results: Iterable[StretchResult], again: Again) -> Iterator[StretchResult]:
    """Yield the results of the stretches of a recording, in their order, each as one pass would have given it.

    What does not follow the one before is replayed `again`, and then does.
    """
    before: StretchResult | None = None
    for result in results:
        before = result if before is None or result.follows(before) else again(result.stretch, before)
        yield before


def total(results: Sequence[StretchResult]) -> list[GroupResult]:
    """Return what became of all messages of a recording, from what the groups made of all its stretches.

    These are the counts of one pass, but for `needed_queue`: each stretch tells it by what overflowed since it was
    read from.
    """
    by_group = zip(*[each.groups for each in results], strict=True)
    return [_sum([each.result for each in stretches]) for stretches in by_group]


def _sum(results: Sequence[GroupResult]) -> GroupResult:
    columns = zip(*[each.inputs for each in results], strict=True)
    inputs = [InputResult(each[0].topic, _summed([part.counts for part in each])) for each in columns]
    return GroupResult(results[0].name, tuple(inputs), sum(each.sets for each in results))


def _summed(counts: Sequence[InputCounts]) -> InputCounts:
    dropped: Counter[DropReason] = Counter()
    for each in counts:
        dropped.update(each.dropped)
    needed = [each.needed_queue for each in counts if each.needed_queue is not None]
    fed, matched = sum(each.fed for each in counts), sum(each.matched for each in counts)
    return InputCounts(fed, matched, dict(dropped), counts[-1].buffered, max(needed, default=None))
