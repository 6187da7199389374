"""What a running relay is like in words: a line for a log, a page for the end."""

from collections.abc import Iterator

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from syncrelay.cli.live import Moment, awaited, ms
from syncrelay.cli.tally import GroupFigures
from syncrelay.sync.counts import InputCounts
from syncrelay.top.names import short_names


def plain_line(moment: Moment) -> str:
    """One line on all groups at a moment, for where nothing can be drawn."""
    return f"{moment.elapsed_s:5.1f} s  " + "; ".join(_in_words(figures) for figures in moment.groups)


def _in_words(figures: GroupFigures) -> str:
    name = figures.state.name
    if not figures.state.sets and (what := awaited(figures.state)):
        return f"{name} waits for {what}"
    rates = f"{name} {figures.sets_hz:.1f} of {figures.best_hz:.1f} sets/s"
    return rates if figures.spans is None else f"{rates}, span {ms(figures.spans.median)}"


def summary(moment: Moment) -> RenderableType:
    """Say at the end what became of everything: sets against the best possible, spans, and each message's fate."""
    heading = Text(f"{moment.title}: {moment.elapsed_s:.1f} s", style="bold")
    return Group(heading, "", _sets(moment), "", _messages(moment), "", *_remarks(moment))


def _sets(moment: Moment) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False, header_style="bold")
    table.add_column("group")
    for heading in ("sets", "possible", "", "span", "p95", "slop"):
        table.add_column(heading, justify="right")
    for figures in moment.groups:
        spans = figures.spans
        table.add_row(
            figures.state.name,
            str(figures.state.sets),
            str(figures.possible),
            f"{figures.state.sets / figures.possible:.0%}" if figures.possible else "",
            ms(spans.median) if spans else "",
            ms(spans.p95) if spans else "",
            ms(figures.plan.slop),
        )
    return table


def _messages(moment: Moment) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False, header_style="bold")
    table.add_column("group")
    table.add_column("input")
    table.add_column("received", justify="right")
    table.add_column("in sets", justify="right")
    table.add_column("dropped")
    for figures in moment.groups:
        inputs = figures.state.inputs
        for index, (name, each) in enumerate(zip(short_names([i.topic for i in inputs]), inputs, strict=True)):
            group = "" if index else figures.state.name
            table.add_row(group, name, str(each.counts.fed), str(each.counts.matched), _drops(each.counts))
    return table


def _drops(counts: InputCounts) -> str:
    """Name the reasons, the most frequent first, two in a line."""
    by_count = sorted(counts.dropped.items(), key=lambda item: -item[1])
    words = [f"{count} {reason.value}" for reason, count in by_count]
    return ",\n".join(", ".join(words[begin : begin + 2]) for begin in range(0, len(words), 2))


def _remarks(moment: Moment) -> Iterator[Text]:
    for figures in moment.groups:
        yield from _on_offsets(figures)
    topics = {each.topic: each.publishers for figures in moment.groups for each in figures.state.inputs}
    for topic, publishers in topics.items():
        if publishers > 1:
            yield Text(f"{topic} has {publishers} publishers: another demo runs, and its messages are counted here.")


def _on_offsets(figures: GroupFigures) -> Iterator[Text]:
    spans, offsets = figures.spans, figures.plan.offsets
    if spans is None or not any(offsets):
        return
    names = short_names([each.topic for each in figures.state.inputs])
    given = ", ".join(f"{offset / 1e6:+g} ms on {name}" for name, offset in zip(names, offsets, strict=True) if offset)
    over = ", more than slop allows" if spans.unshifted > figures.plan.slop else ""
    without = f"Without it, the span of these sets would be {ms(spans.unshifted)}{over}."
    yield Text(f"{figures.state.name}: offset {given}. {without}")
