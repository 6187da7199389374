"""Diagnoses and the graph as text: aligned, the worst first, the verdict last."""

from collections.abc import Iterator, Sequence
from typing import Final

from rich.cells import cell_len

from syncrelay.doctor.diagnosis import Diagnosis, Severity
from syncrelay.doctor.graph import summary
from syncrelay.doctor.stamps import delay_of
from syncrelay.doctor.words import duration
from syncrelay.printable import printable
from syncrelay.ros.sighting import SeenPublisher, SeenTopic, Sighting

_BOLD, _RED, _YELLOW, _DIM, _RESET = "\033[1m", "\033[31m", "\033[33m", "\033[2m", "\033[0m"
_MARK: Final = {Severity.MEND: _RED, Severity.KNOW: _YELLOW}
_INDENT: Final = "      "


def diagnosis_lines(found: Diagnosis, *, colour: bool) -> Iterator[str]:
    """Yield a block: what is so, marked with its severity, then what follows and what to do."""
    mark, bold, dim, reset = (_MARK[found.severity], _BOLD, _DIM, _RESET) if colour else ("", "", "", "")
    first, *rest = found.what.splitlines()
    yield f"{mark}{found.severity.value:<6}{reset}{bold}{printable(first)}{reset}"
    yield from (f"{_INDENT}{printable(line)}" for line in rest)
    yield from _labelled("so", found.so, dim, reset)
    yield from _labelled("do", found.do, dim, reset)


def _labelled(label: str, text: str, dim: str, reset: str) -> Iterator[str]:
    first, *rest = text.splitlines()
    yield f"{_INDENT}{dim}{label}{reset}  {printable(first)}"
    yield from (f"{_INDENT}    {printable(line)}" for line in rest)


def sighting_lines(sighting: Sighting) -> Iterator[str]:
    """Yield what was seen of the graph: a line of counts, then a line for each topic of the file."""
    yield f"seen in {sighting.seconds:.0f} s: {summary(sighting)}"
    yield from aligned([_row(topic) for topic in sighting.topics])


def aligned(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield rows as lines, each column as wide as its widest cell."""
    widths = [max(map(cell_len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        padded = [cell + " " * (width - cell_len(cell)) for cell, width in zip(row, widths, strict=True)]
        yield f"  {'  '.join(padded)}".rstrip()


def _row(topic: SeenTopic) -> tuple[str, ...]:
    delay = delay_of(topic)
    age = "" if delay is None else f"stamps {duration(abs(delay))} {'old' if delay >= 0 else 'ahead'}"
    rate = f"{topic.rate_hz:.1f} Hz" if topic.rate_hz else f"{topic.received} received"
    return topic.name, topic.type, rate, age, _publishers(topic)


def _publishers(topic: SeenTopic) -> str:
    return "; ".join(_publisher(each, topic.type) for each in topic.publishers) or "no publisher"


def _publisher(publisher: SeenPublisher, wanted: str) -> str:
    strange = "" if publisher.type == wanted else f"{publisher.type}, "
    return f"{publisher.node or 'a nameless node'} ({strange}{publisher.offers})"


def verdict(diagnoses: Sequence[Diagnosis]) -> str:
    """Return the last line."""
    to_mend = sum(1 for each in diagnoses if each.severity is Severity.MEND)
    to_know = len(diagnoses) - to_mend
    things = [f"{to_mend} {'thing' if to_mend == 1 else 'things'} to mend"] if to_mend else []
    things += [f"{to_know} to know"] if to_know else []
    if not to_mend:
        things.insert(0, "nothing to mend")
    return ", ".join(things)
