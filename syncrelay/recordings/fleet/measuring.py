"""What one document adds to a fleet's report."""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Final

from syncrelay.recordings.analysis.buckets import floor_of
from syncrelay.recordings.fleet.documents import Document, Group, Input, Quantity, Spread, Topic
from syncrelay.recordings.fleet.suggestions import values_of
from syncrelay.recordings.fleet.tally import WHOLE_PPM, Buckets, Drift, Tally

_SECOND: Final = 1_000_000_000
_EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)
# As analysis_text tells it: two clocks, and no delay of a message.
_OTHER_CLOCK: Final = _SECOND


@dataclass(frozen=True, slots=True)
class Measured:
    """A recording, what it adds up to, and each of its groups and topics alone."""

    name: str
    begin: int
    day: str | None
    whole: Tally
    groups: dict[str, Tally]
    topics: dict[str, Tally]


def measured(name: str, document: Document) -> Measured:
    """Return what a recording's document tells, counted once for each view of it."""
    lasts = max(0, document.end - document.begin)
    topics = {topic: Tally(recordings=1, lasts=lasts) for topic in _topics(document)}
    groups = {group.name: Tally(recordings=1, lasts=lasts) for group in document.groups}
    whole = Tally(recordings=1, lasts=lasts)
    for group in document.groups:
        # Before the clocks, of which the whole counts those of a topic of two groups once.
        of_group = _of_group(group)
        groups[group.name].add(of_group)
        whole.add(of_group)
        for each in group.inputs:
            _count_input(topics[each.topic], each)
        _count_distances(topics, group)
    for topic in document.topics:
        topics[topic.topic].latency.add(_delay(topic.delay))
        clock = _clock(name, topic)
        if clock is None:
            continue
        topics[topic.topic].add(clock)
        for group_name in {group.name for group in document.groups if topic.topic in _inputs(group)}:
            groups[group_name].add(clock)
        whole.add(clock)
    for group in document.groups:
        values = values_of(group)
        groups[group.name].values.count(values, group)
        whole.values.count(values, group)
        for topic_name in set(_inputs(group)):
            at_topic = [value for value in values if value.where.topic == topic_name]
            topics[topic_name].values.count(at_topic, group)
    _count_codes(document, whole, groups, topics)
    return Measured(name, document.begin, day_of(document.begin), whole, groups, topics)


def day_of(nanoseconds: int) -> str | None:
    """Return the day of a time, UTC; None for one that no calendar has."""
    try:
        return f"{_EPOCH + timedelta(microseconds=nanoseconds // 1000):%Y-%m-%d}"
    except OverflowError:
        return None


def _topics(document: Document) -> Iterator[str]:
    yield from (topic.topic for topic in document.topics)
    for group in document.groups:
        yield from _inputs(group)


def _inputs(group: Group) -> Iterator[str]:
    return (each.topic for each in group.inputs)


def _of_group(group: Group) -> Tally:
    suggestion, tally = group.suggestion, Tally()
    tally.judged += 1
    tally.without += not group.sets
    tally.rate(_rate(group))
    tally.sets += group.sets
    tally.now += min(suggestion.now, suggestion.possible)
    tally.possible += suggestion.possible
    _count_quantity(tally.span, group.span)
    _count_quantity(tally.latency, group.latency)
    for each in group.inputs:
        _count_messages(tally, each)
    return tally


def _rate(group: Group) -> int | None:
    suggestion = group.suggestion
    if suggestion.possible:
        return _ppm(suggestion.now, suggestion.possible)
    return None if group.sets else 0


def _count_input(tally: Tally, each: Input) -> None:
    needed = each.received - min(each.unneeded, each.received)
    tally.judged += 1
    tally.without += not each.received
    # Where none was needed, none was missing; where none came, all were.
    tally.rate(_ppm(each.matched, needed) if needed else 0 if not each.received else None)
    _count_messages(tally, each)


def _count_messages(tally: Tally, each: Input) -> None:
    tally.received += each.received
    tally.matched += each.matched
    tally.unneeded += each.unneeded
    tally.dropped.update(each.dropped)


def _count_quantity(buckets: Buckets, quantity: Quantity | None) -> None:
    if quantity is None:
        return
    counts: Counter[int] = Counter()
    for floor, count in quantity.counts.items():
        if count:
            counts[floor_of(floor)] += count
    if counts:
        buckets.count(counts, quantity.least, quantity.greatest)


def _count_distances(topics: dict[str, Tally], group: Group) -> None:
    for pair in group.pairs:
        for topic in {pair.first, pair.second} & topics.keys():
            found = pair.distance
            topics[topic].span.count_one(found.median, least=found.least, greatest=found.greatest)


def _clock(name: str, topic: Topic) -> Tally | None:
    """Return what is wrong with the stamps of a topic; None where that is nothing, as with most."""
    faults = {
        "stamp 0": topic.unstamped,
        "no readable stamp": topic.unreadable,
        "repeated stamp": topic.duplicates,
        "out of order": topic.out_of_order,
    }
    ppm = topic.drift_ppm
    is_other = topic.delay is not None and abs(topic.delay.median) >= _OTHER_CLOCK
    if not (any(faults.values()) or topic.gaps or is_other or ppm):
        return None
    return Tally(
        faults=Counter({word: count for word, count in faults.items() if count}),
        gaps=topic.gaps,
        longest_gap=topic.longest_gap or 0,
        other_clock=int(is_other),
        drift=Drift(abs(ppm), ppm, topic.topic, name) if ppm else None,
    )


def _delay(delay: Spread | None) -> Buckets:
    found = Buckets()
    if delay is not None and abs(delay.median) < _OTHER_CLOCK:
        found.count_one(delay.median, least=delay.least, greatest=delay.greatest)
    return found


def _count_codes(document: Document, whole: Tally, groups: dict[str, Tally], topics: dict[str, Tally]) -> None:
    """Count each code once for a recording, a group and a topic."""
    rows = [(group.name, group.topic_of(each.input), each.code) for group in document.groups for each in group.findings]
    whole.codes = Counter({code for _, _, code in rows})
    for name, tally in groups.items():
        tally.codes = Counter({code for group, _, code in rows if group == name})
    for name, tally in topics.items():
        tally.codes = Counter({code for _, topic, code in rows if topic == name})


def _ppm(part: int, whole: int) -> int:
    return min(WHOLE_PPM, part * WHOLE_PPM // whole)


def worst_severity(severities: Iterable[str]) -> str:
    """Return the worst of findings' severities, `ok` where there is none."""
    found = set(severities)
    return next((each for each in ("error", "warn") if each in found), "ok")
