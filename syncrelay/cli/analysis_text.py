"""An analysis as lines of text."""

from collections.abc import Iterator

from syncrelay.bag.analysis import Analysis, GroupAnalysis, patch
from syncrelay.bag.analysis.curves import queue_curve, slop_curve
from syncrelay.bag.analysis.nearest import Pair
from syncrelay.bag.analysis.topics import TopicFigures
from syncrelay.cli.summary import summarize
from syncrelay.explain import in_words, words
from syncrelay.printable import printable

_SECOND = 1_000_000_000


def report(name: str, analysis: Analysis) -> Iterator[str]:
    """Yield the lines."""
    messages = sum(topic.messages for topic in analysis.topics)
    yield f"{printable(name)}: {words.seconds(analysis.end - analysis.begin)}, {messages} messages of the topics named"
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
    yield f"{topic.messages} messages"
    if topic.period is not None and topic.jitter is not None:
        yield f"{words.rate(topic.rate_hz)}"
        yield f"period {words.duration(topic.period)}, 95 % within {words.duration(topic.jitter)} of it"
    if topic.gaps and topic.longest_gap is not None:
        yield f"{topic.gaps} gaps, the longest {words.duration(topic.longest_gap)}"


def delay_line(topic: TopicFigures) -> str:
    """Return how long after their stamps the messages of a topic were received; asked only where that is known."""
    delay = topic.delay
    assert delay is not None  # noqa: S101  asked for only where there is one
    drift = "" if topic.drift_ppm is None else f"; drift {words.figure(topic.drift_ppm)} ppm"
    if abs(delay.median) >= _SECOND:
        return f"stamps are of another clock: {_long(delay.median)} before receipt{drift}"
    low, middle, high, most = (words.duration(each) for each in (delay.low, delay.median, delay.high, delay.greatest))
    return f"received {middle} after the stamp, 5 to 95 % {low} to {high}, at most {most}{drift}"


def _long(nanoseconds: int) -> str:
    days = nanoseconds / _SECOND / 86_400
    text = f"{words.figure(nanoseconds / _SECOND)} s"
    return f"{text} ({words.figure(days)} days)" if abs(days) >= 1 else text


def _group(each: GroupAnalysis) -> Iterator[str]:
    name = each.group.name
    suggestion = each.suggestion
    yield f"group {name}, {each.group.options.policy}"
    for pair in each.pairs:
        yield f"  {pair_line(pair)}"
    yield from (f"  {line}" for line in _curves(each))
    topics = [topic.topic for topic in each.group.topics]
    counts = zip(topics, each.trial.counts, strict=True)
    yield from (f"  {line}" for line in summarize(name, len(each.trial.sets), counts))
    for lasting in each.findings:
        yield f"  {lasting.finding.severity.name.lower()}, {lasting.seconds} s: {in_words(lasting.finding)}"
    for hint in suggestion.hints:
        yield f"  hint: {hint}"
    if not suggestion.changes:
        if suggestion.possible:
            yield f"  suggestion: none; {suggestion.now} of {suggestion.possible} possible sets come together"
        return
    given = f"{suggestion.then} of {suggestion.possible} possible sets in place of {suggestion.now}"
    yield f"  suggestion, which gives {given}:"
    yield from (f"    {line}" for line in patch(suggestion.changes, {name: topics}).splitlines())
    for reason in dict.fromkeys(f"{change.key}: {change.reason}" for change in suggestion.changes):
        yield f"    # {reason}"


def pair_line(pair: Pair) -> str:
    """Return how far the messages of one topic lie from the nearest of another."""
    low, middle, high = (_signed(each) for each in (pair.signed.low, pair.signed.median, pair.signed.high))
    distance = pair.distance
    return (
        f"{pair.first} to the nearest of {pair.second}: median {middle}, 5 to 95 % {low} to {high}; distance"
        f" {words.duration(distance.median)}, at most {words.duration(distance.greatest)}"
    )


def _signed(nanoseconds: int) -> str:
    return f"{'+' if nanoseconds > 0 else ''}{words.duration(nanoseconds)}"


def _curves(each: GroupAnalysis) -> Iterator[str]:
    found = each.tightest
    if found is None:
        return
    slop = getattr(each.group.options, "slop", None)
    points = slop_curve(found, marks=() if slop is None else (slop,))
    yield f"by slop: {', '.join(f'{words.duration(at)} {words.share(share)}' for at, share, _ in points)}"
    sizes = queue_curve(found, each.slop, marks=(each.group.options.queue_size,))
    yield f"by queue_size: {', '.join(f'{size} {words.share(share)}' for size, share in sizes)}"
