"""Stamps held against the clock and against each other."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Final

from syncrelay.doctor.diagnosis import Diagnosis, know, mend
from syncrelay.doctor.words import duration
from syncrelay.ros.sighting import SeenTopic

_APART_NS: Final = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Matched:
    """A group whose messages are matched by stamp: its topics by their names in the graph, each with its offset."""

    group: str
    offsets_ns: Mapping[str, int]


def delay_of(topic: SeenTopic) -> int | None:
    """Return how far a topic's stamps are behind the clock as they arrive: the median in ns, None without samples."""
    return round(median(topic.delays)) if topic.delays else None


def check_stamps(topics: Sequence[SeenTopic], groups: Sequence[Matched]) -> Iterator[Diagnosis]:
    """Yield stamps that are missing, and clocks that are apart by more than a second."""
    by_stamp = {name for group in groups for name in group.offsets_ns}
    for topic in topics:
        if topic.name in by_stamp:
            yield from _missing(topic)
    delays = {topic.name: delay for topic in topics if (delay := delay_of(topic)) is not None}
    apart = [found for group in groups for found in _apart(group, delays)]
    yield from apart
    if not apart:
        yield from _old({name: delay for name, delay in delays.items() if name in by_stamp})


def _missing(topic: SeenTopic) -> Iterator[Diagnosis]:
    for code, count, what in (
        ("unstamped", topic.unstamped, "have the stamp 0"),
        ("malformed", topic.unreadable, "have no stamp that could be read"),
    ):
        if count:
            yield mend(
                code,
                f"{topic.name}: {count} of {topic.received} messages {what}",
                so="they are dropped, and match nothing",
                do="have the driver fill in header.stamp, or go by arrival, in the file: stamp: receive",
            )


def _apart(group: Matched, delays: Mapping[str, int]) -> Iterator[Diagnosis]:
    """Yield each topic that is apart from the middle of the others, the worst alone where there are two."""
    sampled = {name: delays[name] for name in group.offsets_ns if name in delays}
    while len(sampled) > 1:
        name = _furthest(sampled)
        own = sampled.pop(name)
        other = min(sampled, key=lambda each: abs(sampled[each] - median(sampled.values())))
        off = own - sampled[other]
        if abs(off) <= _APART_NS:
            return
        yield mend(
            "clocks_apart",
            f"{group.group}: the stamps of {name} are {duration(abs(off))} {'behind' if off > 0 else 'ahead of'} those"
            f" of {other}\n(on arrival {_behind(own)} and {_behind(sampled[other])})",
            so="messages of the same moment never match",
            do="set the clocks of the machines or sensors alike (PTP, chrony); a constant difference can be told in\n"
            f"the file, at {name}: offset: {(group.offsets_ns[name] + off) / 1e9:.3f}s",
        )


def _furthest(delays: Mapping[str, int]) -> str:
    """Return the topic furthest from the middle; of two, that furthest from the clock."""
    if len(delays) == 2:  # noqa: PLR2004  their middle is as far from either
        return max(delays, key=lambda name: abs(delays[name]))
    middle = median(delays.values())
    return max(delays, key=lambda name: abs(delays[name] - middle))


def _behind(delay: int) -> str:
    return f"{duration(abs(delay))} {'behind' if delay >= 0 else 'ahead of'} this clock"


def _old(delays: Mapping[str, int]) -> Iterator[Diagnosis]:
    off = {name: delay for name, delay in delays.items() if abs(delay) > _APART_NS}
    if off:
        name = max(off, key=lambda each: abs(off[each]))
        yield know(
            "stamps_off_clock",
            f"stamps are off this machine's clock, all alike: those of {name} are {_behind(off[name])} on arrival",
            so="they match each other; but a topic with `stamp: receive` would not match them",
            do="nothing where a bag is played (rates are as recorded; with --clock, set use_sim_time);\n"
            "else set this machine's clock or that of the sensors",
        )
