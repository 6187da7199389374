"""One group in blocks of lines: figures, findings, inputs, recent sets, connections."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import Final

from rich.text import Text

from syncrelay.explain import RecentDrop, RecentSet
from syncrelay.status.document import Endpoint, Finding, Group, Input
from syncrelay.top import phrases
from syncrelay.top.names import fitted, fitted_names, short_names
from syncrelay.top.pieces import STYLES, bar, line, sparkline, wrapped
from syncrelay.top.strip import (
    MARKS,
    UNNEEDED,
    Mark,
    Window,
    letter_style,
    mark_of,
    newest_stamp,
    strip,
    window_of,
)

_LABEL: Final = 9
_BAR: Final = 24
_FIGURE: Final = 10
_LEAST_TOPIC, _LEAST_NOTES = 16, 22
LANE_LABEL: Final = 13
_NS_PER_MS: Final = 1_000_000
# The recent messages of a fast input would not fill a wider strip.
_WIDEST_STRIP: Final = 160
_PERCENTILES: Final = 44


def title(group: Group, width: int) -> Text:
    """Draw the group's name and options, as a rule across the screen."""
    text = f"── {group.name}: {phrases.options(group)} "
    return line((text + "─" * max(0, width - len(text)), "bold"))


def figures(group: Group, width: int) -> Iterator[Text]:
    """Draw how many sets leave, their spans and their latencies."""
    yield rate_line(group, width)
    if group.last_sets:
        room = max(10, width - _LABEL - _PERCENTILES)
        for name, values, sample in (
            ("span", [each.span_ms for each in group.last_sets], group.span_ms),
            ("latency", [each.latency_ms for each in group.last_sets], group.latency_ms),
        ):
            shown = phrases.percentiles(sample) if sample else ""
            yield line((f"{name:<{_LABEL}}", "bold"), sparkline(values, room), " ", shown)
    yield from offsets(group, width)


def rate_line(group: Group, width: int) -> Text:
    """Draw which share of the possible sets leaves."""
    share = phrases.share_of_possible(group)
    before = f"{phrases.sets_of_possible(group)} possible a second "
    behind = f"{share:.0%}, {phrases.last_set(group)}"
    room = min(_BAR, width - _LABEL - len(before) - len(behind) - 1)
    drawn = (bar(share, room), " ") if room > 0 else ()
    return line((f"{'sets':<{_LABEL}}", "bold"), before, *drawn, behind)


def offsets(group: Group, width: int) -> Iterator[Text]:
    """Say how the file's offsets change the spans, if it has some."""
    if effect := phrases.offsets(group):
        yield from wrapped(effect, width, first=line((f"{'offset':<{_LABEL}}", "bold")))


def findings(group: Group, width: int) -> Iterator[Text]:
    """Draw the findings, the one that explains most first, each with what to do about it."""
    arrow = line(" " * (_LABEL - 2), ("→ ", "bold"))
    for finding in group.findings:
        level = line((f"{finding.severity.name:<{_LABEL}}", STYLES[finding.severity]))
        yield from wrapped(finding.text, width, first=level)
        yield from wrapped(finding.suggestion or "", width, first=arrow, style="italic")


def inputs(group: Group, width: int) -> Iterator[Text]:
    """Draw a line for each input below a heading."""
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
            *_notes(each, group.problem_of(each)),
        )


def _notes(each: Input, problem: Finding | None) -> Iterator[str | tuple[str, str]]:
    if not each.required:
        yield ("optional: ", "dim")
    if problem is not None:
        yield (problem.label, STYLES[problem.severity])
    if each.dropped_lately or problem is None:
        yield f"{'; ' if problem else ''}{phrases.drops_lately(each)}"


def recent_sets(group: Group, width: int) -> Iterator[Text]:
    """Draw the strip of recent sets, with a legend of what is on it."""
    if not group.recent:
        return
    recent = as_matched(group)
    window = window_of(recent, min(width - LANE_LABEL - 2, _WIDEST_STRIP))
    yield from lanes(group, recent, window)
    shown = [each for each in recent if window.column(newest_stamp([each])) is not None]
    drops = [each for each in shown if isinstance(each, RecentDrop)]
    letters = [(letter, letter_style(number)) for number, letter in enumerate("ABC")]
    sets = [line(*letters, " sets")] if len(drops) < len(shown) else []
    yield from side_by_side([*sets, *marks({mark_of(each) for each in drops})], width)
    yield line((f"a column is {phrases.duration(window.column_ns / _NS_PER_MS)}, the newest is on the right", "dim"))


def as_matched(group: Group) -> tuple[RecentSet | RecentDrop, ...]:
    """Return the last sets and drops with the stamps that were matched: offsets added."""
    shifts = [round(each.offset_ms * _NS_PER_MS) for each in group.inputs]
    return tuple(outcome.shifted(shifts) for outcome in group.recent)


def lanes(group: Group, recent: Sequence[RecentSet | RecentDrop], window: Window) -> Iterator[Text]:
    """Draw a lane for each input with its recent messages, and below them the spans of the sets."""
    drawn = strip(recent, window, n_inputs=len(group.inputs), sets=group.sets)
    for index, name in enumerate(short_names([each.topic for each in group.inputs])):
        shift = f" {group.inputs[index].offset_ms:+g} ms" if group.inputs[index].offset_ms else ""
        label = f"{fitted(name, LANE_LABEL - len(shift))}{shift}".rjust(LANE_LABEL)
        yield line((label, "bold"), (" ▏", "dim"), drawn[2 * index])
        below = "span in ms" if index == len(group.inputs) - 1 else ""
        yield line((below.rjust(LANE_LABEL), "dim"), (" ▏", "dim"), drawn[2 * index + 1])


def marks(shown: Collection[Mark]) -> Iterator[Text]:
    """Say what marks of dropped messages mean, each in its style."""
    if UNNEEDED in shown:
        yield line(UNNEEDED, " not needed")
    for reason, mark in MARKS.items():
        if mark in shown:
            yield line(mark, f" {reason.value}: {reason.meaning}")


def side_by_side(texts: Iterable[Text], width: int) -> Iterator[Text]:
    """Put texts beside each other, as many in a line as fit."""
    filled: list[Text] = []
    for text in texts:
        if filled and sum(each.cell_len + 3 for each in filled) + text.cell_len > width:
            yield Text("   ").join(filled)
            filled = []
        filled.append(text)
    yield Text("   ").join(filled)


def connections(group: Group, width: int) -> Iterator[Text]:
    """Say in full who publishes each input, who subscribes to its output, and what became of its messages."""
    for each in group.inputs:
        offset = f", offset {phrases.duration(each.offset_ms)}" if each.offset_ms else ""
        required = "" if each.required else ", optional"
        yield from wrapped(
            f"{each.topic} ({each.type or 'type not known yet'}{required}{offset})", width, first=line(""), style="bold"
        )
        yield from wrapped(_nodes(each.publishers) or "nobody", width, first=line("  from "))
        receivers = _nodes(each.subscribers) or "nobody"
        yield from wrapped(f"{each.output}, to {receivers}", width, first=line("  as   "))
        yield from wrapped(phrases.fates(each), width, first=line("  "))
        if sent := phrases.sent(each):
            yield from wrapped(sent, width, first=line("  "))


def _nodes(endpoints: Sequence[Endpoint]) -> str:
    return ", ".join(each.node + _mismatch(each) for each in endpoints)


def _mismatch(endpoint: Endpoint) -> str:
    why = endpoint.mismatch
    return f" ({why.policy}: {why.offered} offered, {why.requested} requested)" if why else ""
