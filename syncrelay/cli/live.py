"""What a running relay looks like on a terminal: rates, spans, a strip of what was matched, a legend. Drawing only."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from rich.console import Group, RenderableType
from rich.text import Text

from syncrelay.cli.tally import GroupFigures
from syncrelay.ros.snapshot import GroupSnapshot, RelaySnapshot
from syncrelay.sync.messages import DropReason
from syncrelay.top.names import short_names
from syncrelay.top.strip import COLUMN_NS, MARKS, Lanes, Sweep, drop_style, letter_style, newest_stamp, strip

_LABEL = 13
_BAR = 26
# A share of the sets that losses on the way explain.
_FINE = 0.9
# On a wider strip the recent outcomes of a 100 Hz input would not reach back to the begin.
_MAX_STRIP = 108

_MEANINGS: Mapping[DropReason, str] = MappingProxyType(
    {
        DropReason.SUPERSEDED: "a newer set left",
        DropReason.TOO_FAR: "nothing within slop",
        DropReason.LATE: "older than the last set",
        DropReason.DUPLICATE: "stamp came twice",
        DropReason.OVERFLOW: "queue full",
        DropReason.EXPIRED: "waited for max_wait",
        DropReason.TIME_JUMP: "the clock fell back",
        DropReason.UNSTAMPED: "its stamp is 0",
        DropReason.MALFORMED: "no stamp to read",
        DropReason.THINNED: "over max_rate",
        DropReason.SHUTDOWN: "the relay ended",
    }
)
# What every newcomer meets, whether it has happened yet or not.
_ALWAYS_EXPLAINED = frozenset({DropReason.SUPERSEDED, DropReason.TOO_FAR})


@dataclass(frozen=True, slots=True)
class Moment:
    """What is drawn: the groups' figures, `elapsed_s` seconds after the start, of `total_s` if an end is set."""

    title: str
    groups: tuple[GroupFigures, ...]
    elapsed_s: float
    total_s: float | None


def frame(moment: Moment, *, width: int, height: int) -> RenderableType:
    """Draw a moment for a terminal of so many columns and lines; 80x24 shows all of two groups of two inputs."""
    snapshot = RelaySnapshot(tuple(figures.state for figures in moment.groups))
    recent = (outcome for group in snapshot.groups for outcome in group.recent)
    sweep = Sweep(head=newest_stamp(recent), width=min(width - _LABEL - 2, _MAX_STRIP))
    blocks = [
        [_title(moment, width)],
        *(_group_block(figures, sweep) for figures in moment.groups),
        list(_legend(snapshot, sweep, width)),
    ]
    lines_used = sum(len(block) for block in blocks)
    gaps = min(1, max(0, (height - lines_used) // (len(blocks) - 1)))
    return Group(*_stacked(blocks, gap=[Text("")] * gaps))


def _stacked(blocks: Sequence[Sequence[Text]], *, gap: Sequence[Text]) -> Iterator[Text]:
    for index, block in enumerate(blocks):
        if index:
            yield from gap
        yield from block


def _title(moment: Moment, width: int) -> Text:
    clock = f"{moment.elapsed_s:.1f}" + (" s" if moment.total_s is None else f" / {moment.total_s:g} s")
    title = Text(moment.title, style="bold", no_wrap=True)
    title.truncate(width - len(clock) - 1, overflow="ellipsis", pad=True)
    return Text.assemble(title, " ", clock)


def _group_block(figures: GroupFigures, sweep: Sweep) -> list[Text]:
    inputs = figures.state.inputs
    names = short_names([each.topic for each in inputs])
    return [
        _rate_line(figures),
        _span_line(figures),
        *_lanes(figures, names, sweep),
        *(_fate_line(figures, lane, name) for lane, name in enumerate(names)),
    ]


def awaited(state: GroupSnapshot) -> str | None:
    """Return what a group waits for: its inputs without a publisher by their short names, or what else it says."""
    names = short_names([each.topic for each in state.inputs])
    missing = [name for name, each in zip(names, state.inputs, strict=True) if not each.publishers]
    return ", ".join(missing) or state.waiting_for


def _rate_line(figures: GroupFigures) -> Text:
    name = (f"{figures.state.name:<{_LABEL}}  ", "bold")
    if not figures.state.sets:
        what = awaited(figures.state)
        return _line(name, (f"waiting for {what}" if what else "no set yet", "bold yellow"))
    share = min(1.0, figures.sets_hz / figures.best_hz) if figures.best_hz else 0.0
    filled = round(share * _BAR)
    return _line(
        name,
        f"{figures.sets_hz:.1f} of {figures.best_hz:.1f} sets/s possible  ",
        ("━" * filled, "bold green" if share >= _FINE else "bold yellow"),
        ("╌" * (_BAR - filled), "dim"),
        (f" {share:.0%}", "bold"),
    )


def _span_line(figures: GroupFigures) -> Text:
    if figures.spans is None:
        return _line(f"  {figures.plan.policy}, slop {ms(figures.plan.slop)}")
    spans = figures.spans
    text = f"  span {ms(spans.median)} median, {ms(spans.p95)} p95, slop {ms(figures.plan.slop)}"
    if not any(figures.plan.offsets):
        return _line(text)
    over = spans.unshifted > figures.plan.slop
    return _line(text, "; ", (f"without offset {ms(spans.unshifted)}{': over slop' if over else ''}", "bold"))


def ms(nanoseconds: int) -> str:
    """Write a time in milliseconds: whole ones bare, others with a digit behind the point."""
    value = nanoseconds / 1e6
    return f"{value:.0f} ms" if value == round(value) else f"{value:.1f} ms"


def _lanes(figures: GroupFigures, names: Sequence[str], sweep: Sweep) -> Iterator[Text]:
    state = figures.state
    drawn = strip(Lanes(_fed(state), state.sets, state.recent), sweep)
    for index, (name, offset) in enumerate(zip(names, figures.plan.offsets, strict=True)):
        shift = f" {offset / 1e6:+.0f} ms" if offset else ""
        yield _line((f"{name[: _LABEL - len(shift)]}{shift}".rjust(_LABEL), "bold"), (" ▏", "dim"), drawn[2 * index])
        label = "span in ms" if index == len(names) - 1 else ""
        yield _line((label.rjust(_LABEL), "dim"), (" ▏", "dim"), drawn[2 * index + 1])


def _fate_line(figures: GroupFigures, lane: int, name: str) -> Text:
    counts = figures.state.inputs[lane].counts
    style = drop_style(_fed(figures.state), lane)
    line = _line(f"{name:>{_LABEL}}  {figures.input_hz[lane]:5.1f}/s, {counts.matched} in sets, dropped: ")
    return line.append_text(Text(", ").join(_drops(counts.dropped, style)) if counts.dropped else Text("none"))


def _fed(state: GroupSnapshot) -> tuple[int, ...]:
    return tuple(each.counts.fed for each in state.inputs)


def _drops(dropped: Mapping[DropReason, int], style: str) -> Iterator[Text]:
    for reason, count in sorted(dropped.items(), key=lambda item: -item[1]):
        yield Text.assemble(f"{count} {reason.value} ", (MARKS[reason], style))


def _legend(snapshot: RelaySnapshot, sweep: Sweep, width: int) -> Iterator[Text]:
    letters = Text(" ").join(Text(letter, letter_style(number)) for number, letter in enumerate("ABC"))
    yield _line(letters, "  each letter is a set: messages matched by time and sent on together")
    yield from _filled([_explained(reason) for reason in _reasons(snapshot)], width)
    seconds = sweep.width * COLUMN_NS / 1e9
    yield _line((f"column {ms(COLUMN_NS)}, strip {seconds:.1f} s, then again from the left; Ctrl-C ends it", "dim"))


def _reasons(snapshot: RelaySnapshot) -> list[DropReason]:
    occurred = {reason for group in snapshot.groups for each in group.inputs for reason in each.counts.dropped}
    return [reason for reason in MARKS if reason in occurred | _ALWAYS_EXPLAINED]


def _explained(reason: DropReason) -> Text:
    return Text.assemble((MARKS[reason], "bold"), f" {reason.value}: {_MEANINGS[reason]}")


def _filled(texts: Sequence[Text], width: int) -> Iterator[Text]:
    """Set texts side by side, as many in a line as fit."""
    line = Text()
    for text in texts:
        if line and line.cell_len + text.cell_len + 3 > width:
            yield line
            line = Text()
        line = Text.assemble(line, "   " if line else "", text)
    yield line


def _line(*parts: str | Text | tuple[str, str]) -> Text:
    return Text.assemble(*parts, no_wrap=True, overflow="ellipsis")
