"""What there is to see of one group, in blocks of lines: figures, findings, inputs, recent sets, connections."""

from collections.abc import Iterator, Sequence
from typing import Final

from rich.text import Text

from syncrelay.explain import RecentDrop, RecentSet
from syncrelay.status import Level
from syncrelay.top import phrases
from syncrelay.top.names import fitted, fitted_names, short_names
from syncrelay.top.pieces import STYLES, bar, line, sparkline, wrapped
from syncrelay.top.state import Endpoint, Finding, Group, Input, Percentiles
from syncrelay.top.strip import MARKS, Lanes, drop_style, letter_style, newest_stamp, strip, window_of

_LABEL: Final = 9
_BAR: Final = 24
_FIGURE: Final = 10
_LEAST_TOPIC, _LEAST_NOTES = 16, 22
_LANE_LABEL: Final = 13
# On a wider strip the recent outcomes of a fast input would not reach back to its begin.
_WIDEST_STRIP: Final = 160
_LINES_OF_SPARKS: Final = 44


def title(group: Group, width: int) -> Text:
    """Draw the group's name and what the file says of it, as a rule across the screen."""
    text = f"── {group.name}: {phrases.keys(group)} "
    return line((text + "─" * max(0, width - len(text)), "bold"))


def figures(group: Group, width: int) -> Iterator[Text]:
    """Draw how many sets leave, their spans and their latencies."""
    share = phrases.share_of_possible(group)
    before = f"{phrases.sets_of_possible(group)} possible a second "
    behind = f" {share:.0%}, {phrases.last_set(group)}"
    room = width - _LABEL - len(before) - len(behind)
    yield line((f"{'sets':<{_LABEL}}", "bold"), before, bar(share, max(0, min(_BAR, room))), behind)
    if not group.last_sets:
        return
    room = max(10, width - _LABEL - _LINES_OF_SPARKS)
    spans = [each.span_ms for each in group.last_sets]
    latencies = [each.latency_ms for each in group.last_sets]
    yield line((f"{'span':<{_LABEL}}", "bold"), sparkline(spans, room), " ", _percentiles(group.span_ms))
    yield line((f"{'latency':<{_LABEL}}", "bold"), sparkline(latencies, room), " ", _percentiles(group.latency_ms))


def _percentiles(sample: Percentiles | None) -> str:
    if sample is None:
        return ""
    values = (("p50", sample.p50), ("p95", sample.p95), ("max", sample.max))
    return ", ".join(f"{name} {phrases.duration(value)}" for name, value in values)


def findings(group: Group, width: int) -> Iterator[Text]:
    """Say what is so and what to do about it, what explains most first."""
    first = group.explanation
    others = [finding for finding in group.findings if finding is not first]
    for finding in [first, *others] if first else []:
        yield from _finding(finding, width)


def _finding(finding: Finding, width: int) -> Iterator[Text]:
    level = line((f"{phrases.LEVELS[finding.severity]:<{_LABEL}}", STYLES[finding.severity]))
    yield from wrapped(finding.text, width, first=level)
    if finding.suggestion:
        yield from wrapped(finding.suggestion, width, first=line(" " * (_LABEL - 2), ("→ ", "bold")), style="italic")


def inputs(group: Group, width: int) -> Iterator[Text]:
    """Draw a line for each input, and one above that names the columns."""
    longest = max(len(each.topic) for each in group.inputs)
    room = max(_LEAST_TOPIC, min(longest, width - 3 * _FIGURE - _LEAST_NOTES - 1))
    names = fitted_names([each.topic for each in group.inputs], room)
    columns = "".join(f"{name:<{_FIGURE}}" for name in ("RATE", "LAG", "JITTER"))
    wide = max(map(len, names)) + 1
    yield line((f"{'INPUT':<{wide}}{columns}DROPPED IN 10 s", "bold"))
    for name, each in zip(names, group.inputs, strict=True):
        yield line(
            f"{name:<{wide}}",
            f"{phrases.rate(each.rate_hz):<{_FIGURE}}",
            f"{phrases.duration(each.lag_ms):<{_FIGURE}}",
            f"{phrases.duration(each.jitter_ms):<{_FIGURE}}",
            *_notes(each),
        )


def _notes(each: Input) -> Iterator[str | tuple[str, str]]:
    if not each.required:
        yield ("optional: ", "dim")
    trouble = phrases.trouble(each)
    if trouble is None:
        yield phrases.drops(each.dropped_lately)
        return
    yield (trouble, STYLES[Level.ERROR if each.required else Level.WARN])
    if each.dropped_lately:
        yield f"; {phrases.drops(each.dropped_lately)}"


def recent_sets(group: Group, width: int) -> Iterator[Text]:
    """Draw the strip of recent sets, with a legend of what is on it."""
    if not group.recent:
        return
    offsets = [round(each.offset_ms * 1_000_000) for each in group.inputs]
    recent = tuple(outcome.shifted(offsets) for outcome in group.recent)
    window = window_of(recent, min(width - _LANE_LABEL - 2, _WIDEST_STRIP))
    fed = tuple(each.received for each in group.inputs)
    drawn = strip(Lanes(fed, group.sets, recent), window)
    for index, name in enumerate(short_names([each.topic for each in group.inputs])):
        label = fitted(name, _LANE_LABEL).rjust(_LANE_LABEL)
        yield line((label, "bold"), (" ▏", "dim"), drawn[2 * index])
        below = "span in ms" if index == len(fed) - 1 else ""
        yield line((below.rjust(_LANE_LABEL), "dim"), (" ▏", "dim"), drawn[2 * index + 1])
    yield _legend([each for each in recent if window.column(newest_stamp([each])) is not None], fed)
    yield line((f"a column is {phrases.duration(window.column_ns / 1_000_000)}, the newest is on the right", "dim"))


def _legend(shown: Sequence[RecentSet | RecentDrop], fed: Sequence[int]) -> Text:
    parts = []
    if any(isinstance(each, RecentSet) for each in shown):
        parts.append(line(*((letter, letter_style(number)) for number, letter in enumerate("ABC")), " sets"))
    for reason in MARKS:
        styles = {
            drop_style(fed, each.input) for each in shown if isinstance(each, RecentDrop) and each.reason is reason
        }
        if styles:
            # The style that stands out is the longer.
            parts.append(line((MARKS[reason], max(styles, key=len)), f" {reason.value}"))
    return Text("   ").join(parts)


def connections(group: Group, width: int) -> Iterator[Text]:
    """Say of each input in full who publishes it, who gets its output, and what became of its messages."""
    for each in group.inputs:
        offset = f", offset {phrases.duration(each.offset_ms)}" if each.offset_ms else ""
        required = "" if each.required else ", optional"
        yield from wrapped(f"{each.topic} ({each.type}{required}{offset})", width, first=line(""), style="bold")
        yield from wrapped(_nodes(each.publishers) or "nobody", width, first=line("  from "))
        receivers = _nodes(each.subscribers) or "nobody"
        yield from wrapped(f"{each.output}, to {receivers}", width, first=line("  as   "))
        yield from wrapped(phrases.fates(each), width, first=line("  "))


def _nodes(endpoints: Sequence[Endpoint]) -> str:
    return ", ".join(each.node + _mismatch(each) for each in endpoints)


def _mismatch(endpoint: Endpoint) -> str:
    why = endpoint.mismatch
    return f" ({why.policy}: {why.offered} offered, {why.requested} requested)" if why else ""
