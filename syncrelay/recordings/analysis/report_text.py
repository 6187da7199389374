"""What a recording holds, and what groups make of it, as lines of text."""

from collections.abc import Iterator, Sequence
from shlex import quote
from typing import Final

from syncrelay.config.wording import counted
from syncrelay.explain import in_words, words
from syncrelay.explain.summary import why_unneeded
from syncrelay.printable import aligned, printable
from syncrelay.recordings.analysis import Analysis, GroupAnalysis, Topic, patch
from syncrelay.recordings.analysis.curves import Curves, Point, slop_key
from syncrelay.recordings.analysis.pairs import Pair, worth_seeing
from syncrelay.recordings.analysis.suggest import Suggestion
from syncrelay.recordings.analysis.topics import TopicFigures
from syncrelay.recordings.analysis.unneeded import InputFates
from syncrelay.recordings.bag import Recording

_SECOND: Final = 1_000_000_000
_HEADING: Final = ("topic", "type", "messages", "rate", "stamps")


def report(name: str, analysis: Analysis) -> Iterator[str]:
    """Yield the lines."""
    messages = sum(topic.messages for topic in analysis.topics)
    of = f"{counted(messages, 'message')} of {counted(len(analysis.topics), 'topic')}"
    yield f"{printable(name)}: {words.seconds(analysis.end - analysis.begin)}, {of}"
    for topic in analysis.topics:
        yield ""
        yield from _topic(topic)
    for group in analysis.groups:
        yield ""
        yield from _group(group)


def _topic(topic: TopicFigures) -> Iterator[str]:
    yield f"{topic.topic} ({topic.type})"
    yield f"  {', '.join(_rhythm(topic))}"
    faults = faults_of(topic)
    if faults:
        yield f"  stamps: {', '.join(faults)}"
    if topic.delay is not None:
        yield f"  {delay_line(topic)}"


def faults_of(topic: TopicFigures) -> list[str]:
    """Return what is wrong with a topic's stamps, and how often."""
    faults = (
        (topic.unstamped, "with stamp 0"),
        (topic.unreadable, "without a readable stamp"),
        (topic.duplicates, "repeat a stamp"),
        (topic.out_of_order, "out of order"),
    )
    return [f"{count} {word}" for count, word in faults if count]


def _rhythm(topic: TopicFigures) -> Iterator[str]:
    yield counted(topic.messages, "message")
    if topic.period is not None:
        yield f"{words.rate(topic.rate_hz)}"
        yield f"period {period_text(topic)}"
    if topic.gaps and topic.longest_gap is not None:
        yield f"{counted(topic.gaps, 'gap')}, longest {words.duration(topic.longest_gap)}"


def period_text(topic: TopicFigures) -> str:
    """Return a topic's period and its jitter; empty without a period."""
    if topic.period is None:
        return ""
    return words.duration(topic.period) + (
        f", 95 % within {words.duration(topic.jitter)} of it" if topic.jitter else ""
    )


def delay_line(topic: TopicFigures) -> str:
    """Return how long after or before their stamps a topic's messages were received; `topic.delay` must be known."""
    delay = topic.delay
    assert delay is not None  # noqa: S101  see above
    drift = "" if topic.drift_ppm is None else f"; drift {words.figure(topic.drift_ppm)} ppm"
    is_after = delay.median >= 0
    side = "after" if is_after else "before"
    if abs(delay.median) >= _SECOND:
        return f"received {_long(abs(delay.median))} {side} the stamp{drift}"
    figures = (delay.low, delay.median, delay.high, delay.greatest)
    if not is_after:
        figures = (-delay.high, -delay.median, -delay.low, -delay.least)
    low, middle, high, most = map(words.duration, figures)
    spread = "" if low == most else f" (90 % between {low} and {high}, at most {most})"
    return f"received {middle} {side} the stamp{spread}{drift}"


def _long(nanoseconds: int) -> str:
    days = nanoseconds / _SECOND / 86_400
    text = f"{words.figure(nanoseconds / _SECOND)} s"
    return f"{text} ({words.figure(days)} days)" if abs(days) >= 1 else text


def _group(each: GroupAnalysis) -> Iterator[str]:
    yield f"group {each.group.name}, {each.group.options.policy}"
    yield f"  {_sets(each)}"
    for row in each.fates:
        yield f"  {row.topic}: {', '.join(_fates(row))}"
    yield from (f"  {mapped}" for mapped, _ in each.mapped)
    shown = worth_seeing(each.pairs)
    for at in shown:
        yield f"  {pair_line(each.pairs[at])}"
    others = [pair for at, pair in enumerate(each.pairs) if at not in shown]
    if others:
        yield f"  {other_pairs(others)}: --html and --json have them"
    yield from (f"  {line}" for line in _curves(each))
    for lasting in each.findings:
        yield f"  {lasting.finding.severity.name.lower()}, for {lasting.seconds} s: {in_words(lasting.finding)}"
    yield from suggestion_lines(each)


def suggestion_lines(each: GroupAnalysis) -> Iterator[str]:
    """Yield the suggested values as lines of the file, and what they would give."""
    name, suggestion = each.group.name, each.suggestion
    for hint in suggestion.hints:
        yield f"  hint: {hint}"
    if suggestion.changes:
        yield f"  suggestion: {promise(suggestion)} with"
        topics = [topic.topic for topic in each.group.topics]
        yield from (f"    {line}" for line in patch(suggestion.changes, {name: topics}).splitlines())
        for reason in dict.fromkeys(f"{change.key}: {change.reason}" for change in suggestion.changes):
            yield f"    # {reason}"
    elif suggestion.possible:
        yield "  suggestion: none, no better values of the whole group were found"


def _sets(each: GroupAnalysis) -> str:
    suggestion, sets = each.suggestion, len(each.evaluation.sets)
    if not suggestion.possible:
        return counted(sets, "set")
    together = f"{suggestion.now} of {counted(suggestion.possible, 'possible set')}"
    if sets == suggestion.now:
        return together
    options = each.group.options
    if options.transforms is not None:
        return f"{counted(sets, 'set')} after waiting for transforms, {together}"
    if options.every > 1 or options.max_rate:
        return f"{counted(sets, 'set')} after thinning, {together}"
    return f"{counted(sets, 'set')}, {together}: the others are not of the nearest messages"


def _fates(row: InputFates) -> Iterator[str]:
    yield f"{row.received} received"
    yield f"{row.matched} in sets"
    if row.unneeded:
        yield f"{row.unneeded} not needed ({why_unneeded(row.lacking)})"
    if row.dropped:
        reasons = sorted(row.dropped.items(), key=lambda item: -item[1])
        told = ", ".join(f"{reason.value} {count}" for reason, count in reasons)
        yield f"{sum(row.dropped.values())} dropped ({told})"


def promise(suggestion: Suggestion) -> str:
    """Return how many sets the values of the file give, and how many the suggested ones."""
    if suggestion.then == suggestion.now:
        return f"as many sets as now ({suggestion.then} of {suggestion.possible} possible), and the gains listed below,"
    return f"{suggestion.now} -> {suggestion.then} of {counted(suggestion.possible, 'possible set')}"


def slop_text(each: GroupAnalysis, point: Point) -> str:
    """Return a slop of a curve, marked if it is in use or suggested."""
    return _marked(each, slop_key(each.group) or "", point, words.duration(point.value))


def size_text(each: GroupAnalysis, point: Point) -> str:
    """Return a queue size of a curve, marked if it is in use or suggested."""
    return _marked(each, "queue_size", point, str(point.value))


def _marked(each: GroupAnalysis, option: str, point: Point, text: str) -> str:
    if getattr(each.group.options, option, None) == point.value:
        return f"{text} (in use)"
    return f"{text} (suggested)" if getattr(each.suggested.options, option, None) == point.value else text


def sampled_line(curves: Curves) -> str:
    """Return on how much of a long recording other values were tried; empty if on all of it."""
    if curves.is_of_all:
        return ""
    return f"tried on the first {words.seconds(curves.lasts)}: {curves.messages} of {curves.recorded} messages"


def other_pairs(pairs: Sequence[Pair]) -> str:
    """Return how far apart the pairs are that get no line of their own."""
    most = words.duration(max(pair.distance.high for pair in pairs))
    return f"{counted(len(pairs), 'more pair')}, less far apart (95 % of the messages within {most})"


def pair_line(pair: Pair) -> str:
    """Return how far the messages of one topic are from the nearest ones of another."""
    low, middle, high = (_signed(each) for each in (pair.signed.low, pair.signed.median, pair.signed.high))
    to = f"{pair.first} to the nearest {pair.second}"
    if pair.signed.least == pair.signed.greatest:
        return f"{to}: always {middle}"
    most = words.duration(pair.distance.greatest)
    return f"{to}: median {middle}, 90 % between {low} and {high}, at most {most} apart"


def _signed(nanoseconds: int) -> str:
    return f"{'+' if nanoseconds > 0 else ''}{words.duration(nanoseconds)}"


def _curves(each: GroupAnalysis) -> Iterator[str]:
    curves = each.curves
    if curves is None:
        return
    sampled = "" if curves.is_of_all else f" ({sampled_line(curves)})"
    for option, points, text in (
        (slop_key(each.group), curves.by_slop, slop_text),
        ("queue_size", curves.by_queue_size, size_text),
    ):
        if points:
            yield f"sets by {option}{sampled}: {', '.join(f'{point.sets} at {text(each, point)}' for point in points)}"


def inventory_lines(name: str, recording: Recording, topics: Sequence[Topic]) -> Iterator[str]:
    """Yield the topics of a recording with their types, counts, rates and stamps, then what to type next."""
    messages = sum(topic.figures.messages for topic in topics)
    lasts = words.seconds(recording.end - recording.begin)
    yield f"{printable(name)}: {lasts}, {counted(messages, 'message')} of {counted(len(topics), 'topic')}"
    yield from aligned([_HEADING, *map(_row, topics)])
    yield from _next(name, [topic.channel.topic for topic in topics if topic.unfit is None])


def _row(topic: Topic) -> tuple[str, ...]:
    figures = topic.figures
    rate = words.rate(figures.rate_hz) if figures.rate_hz else "-"
    return topic.channel.topic, topic.channel.type or "-", str(figures.messages), rate, _stamps(topic)


def _stamps(topic: Topic) -> str:
    if topic.lack is not None:
        return f"none: {topic.lack}"
    if not topic.figures.messages:
        return "-"
    faults, delay = faults_of(topic.figures), topic.figures.delay
    if delay is None:
        return ", ".join(faults) or "equal to receipt"
    return ", ".join([f"{words.earlier(delay.median)} receipt", *faults])


def _next(bag: str, fit: Sequence[str]) -> Iterator[str]:
    """Yield what to type with this recording, whose name is quoted for a shell."""
    name = quote(printable(bag))
    yield ""
    if len(fit) < 2:  # noqa: PLR2004  one alone has nothing to be matched with
        yield "No two topics have stamps and enough messages. In a file, `stamp: receive` matches a topic by arrival."
        return
    yield "Next, to match two topics or more:"
    yield f"  syncrelay analyze {name} {' '.join(fit[:2])}"
    yield "or to get a file for all of them, and see what it gives:"
    yield f"  syncrelay init --from-bag {name} -o fusion.yaml"
    yield f"  syncrelay analyze {name} --config fusion.yaml"
