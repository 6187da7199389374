"""The messages of a drawn or simulated case, in order of receipt."""

from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import takewhile
from typing import Final, NamedTuple

from syncrelay.cdr import LATEST_STAMP
from syncrelay.clock import DeviceClock
from syncrelay.config import GroupConfig
from syncrelay.explain import UNREADABLE
from syncrelay.recordings.analysis.streams import Stream
from syncrelay.recordings.cases.drawing import Drawing
from syncrelay.recordings.cases.models import Case, InputSource
from syncrelay.rig.schedule import Sensor, schedule
from syncrelay.rig.what_if import Fault, disturbances

SECOND: Final = 1_000_000_000
START: Final = 1_700_000_000 * SECOND
"""When a case begins. Any time far from 0 would do, as 0 is an unset stamp."""

_AS_DRAWN: Final = InputSource()
_ALL: Final = 1_000_000


class Arrival(NamedTuple):
    """A message: time of receipt and stamp in nanoseconds, input, key, and its letter if it is drawn."""

    received: int
    input: int
    stamp: int
    key: Hashable
    letter: str


def arrivals(
    case: Case, drawing: Drawing | None, group: GroupConfig, places: Mapping[str, int], what_if: Sequence[Fault]
) -> tuple[list[Arrival], list[str]]:
    """Return the messages, and a sentence for each fault that changed nothing.

    `places` maps the names that the case uses to inputs.
    """
    sources = {places[name]: source for name, source in case.inputs.items()}
    found: list[Arrival] = [] if drawing is None else list(_drawn(drawing, case.period, sources, places, group))
    for index, source in sources.items():
        if source.rate is not None:
            found += _simulated(source, index, case, group)
    return _disturbed(
        found, group, what_if, seed=case.seed, is_ordered=drawing is not None and drawing.order is not None
    )


def streams(received: Sequence[Arrival], group: GroupConfig) -> tuple[Stream, ...]:
    """Return the messages as the analysis takes them: a stream for each input."""
    came: list[list[tuple[int, int, int]]] = [[] for _ in group.topics]
    keys: list[list[Hashable]] = [[] for _ in group.topics]
    for place, each in enumerate(received):
        came[each.input].append((each.stamp, each.received, place))
        keys[each.input].append(each.key)
    return tuple(
        replace(Stream.of(topic.topic, topic.type or "", came[at]), keys=None if topic.key is None else keys[at])
        for at, topic in enumerate(group.topics)
    )


def _drawn(
    drawing: Drawing,
    period: int,
    sources: Mapping[int, InputSource],
    places: Mapping[str, int],
    group: GroupConfig,
) -> Iterator[Arrival]:
    def arrival(letter: str) -> Arrival:
        label, column = drawing.marks[letter]
        index = places[label]
        source = sources.get(index, _AS_DRAWN)
        measured = START + column * period
        stamp = _clamped(measured + source.offset)
        return Arrival(measured + source.latency, index, stamp, drawing.keys.get(letter, letter), letter)

    found = [arrival(letter) for letter in drawing.marks]
    by_letter = {each.letter: each for each in found}
    received = [by_letter[letter] for letter in drawing.order or ()] or sorted(found, key=lambda each: each[:2])
    now = 0
    for each in received:
        now = max(now, each.received)
        yield _readable(each._replace(received=now), sources, group)


def _simulated(source: InputSource, index: int, case: Case, group: GroupConfig) -> Iterator[Arrival]:
    assert source.rate is not None and case.lasts is not None  # noqa: S101, PT018  checked as the file was read
    if source.drop == _ALL:
        # Its schedule would search forever for a message that is not lost.
        return
    sensor = Sensor(
        topic=group.inputs.names[index],
        rate_hz=Fraction(SECOND, source.rate),
        phase=source.phase,
        clock_error=source.offset,
        jitter=source.jitter,
        latency=source.latency,
        latency_jitter=source.latency_jitter,
        loss=source.drop / _ALL,
        reliable=True,
    )
    # 30 Hz for 2 s are 60 messages, although the period is rounded down by a third of a nanosecond.
    time = case.lasts - source.phase
    slack = min(time // source.rate // 2 + 1, (source.rate - 1) // 2)
    messages = -(-(time - slack) // source.rate)
    for shot in takewhile(lambda shot: shot.number < messages, schedule(sensor, seed=case.seed, start=START)):
        # Messages that are not drawn have their number as key.
        arrival = Arrival(shot.sent, index, _clamped(shot.stamp), shot.number, "")
        yield _readable(arrival, {index: source}, group)


def _readable(arrival: Arrival, sources: Mapping[int, InputSource], group: GroupConfig) -> Arrival:
    """Return a message as the group reads it: one whose key is in another field cannot be read."""
    topic = group.topics[arrival.input]
    there = sources.get(arrival.input, _AS_DRAWN).field
    if topic.key is not None and there is not None and topic.key != there:
        return arrival._replace(stamp=UNREADABLE, key=None)
    return arrival


def _disturbed(
    received: Sequence[Arrival], group: GroupConfig, what_if: Sequence[Fault], *, seed: int, is_ordered: bool
) -> tuple[list[Arrival], list[str]]:
    names = group.inputs.names
    at_work = disturbances(what_if, names, seed=seed, began=START)
    found: list[Arrival] = []
    for each in received if is_ordered else sorted(received, key=lambda each: each.received):
        disturbance = at_work.get(names[each.input])
        if disturbance is not None:
            later = disturbance.received(each.received)
            if later is None:
                continue
            stamp = each.stamp if each.stamp == UNREADABLE else _clamped(disturbance.stamp(each.stamp, each.received))
            found.append(each._replace(received=later, stamp=stamp))
        else:
            found.append(each)
    by_receipt = sorted(found, key=lambda each: each.received)
    idle = [sentence for each in at_work.values() for sentence in each.idle()]
    clocks = [topic.device_clock() for topic in group.topics]
    return [_stamped(each, group, clocks[each.input]) for each in by_receipt], idle


def _stamped(arrival: Arrival, group: GroupConfig, clock: DeviceClock | None) -> Arrival:
    if arrival.stamp == UNREADABLE:
        return arrival
    if clock is not None:
        return arrival._replace(stamp=clock.host_time(arrival.stamp, arrival.received))
    return arrival._replace(stamp=arrival.received) if group.topics[arrival.input].stamp == "receive" else arrival


def _clamped(stamp: int) -> int:
    """Limit a stamp to what a header can hold."""
    return max(0, min(stamp, LATEST_STAMP))
