"""An examination as a whole: as lines of text, aligned, the worst first, the verdict last; and as JSON."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any, Final

from syncrelay.config.wording import counted
from syncrelay.doctor.diagnosis import Diagnosis, Severity
from syncrelay.doctor.examine import Examination, Observed
from syncrelay.explain import Code, GroupFacts, InputFacts, words
from syncrelay.printable import aligned, printable
from syncrelay.status.as_document import group_of

_THROUGH: Final = {"compiled": "librcl in compiled code", "rclpy": "rclpy"}
_BOLD, _RED, _YELLOW, _DIM, _RESET = "\033[1m", "\033[31m", "\033[33m", "\033[2m", "\033[0m"
_MARK: Final = {Severity.ERROR: _RED, Severity.WARNING: _YELLOW, Severity.INFO: _BOLD}
_INDENT: Final = " " * len("warning  ")
_LONG: Final = 100_000_000_000


def is_ok(examination: Examination) -> bool:
    """Tell whether nothing has to be fixed."""
    return all(each.severity is Severity.INFO for each in examination.diagnoses)


def lines(examination: Examination, *, colour: bool) -> Iterator[str]:
    """Yield what is installed, what was observed, each diagnosis, and the verdict."""
    yield printable(heading(examination))
    if examination.observed is not None:
        yield from observed_lines(examination.observed)
    for diagnosis in examination.diagnoses:
        yield ""
        yield from diagnosis_lines(diagnosis, colour=colour)
    yield from ("", verdict(examination.diagnoses))


def heading(examination: Examination) -> str:
    """Return the first line: what is installed, how nodes find each other, and how messages would pass."""
    installation = examination.installation
    rclpy = f"rclpy {installation.version or '(version unknown)'}" if installation.rclpy else "no rclpy"
    return ", ".join(
        [
            f"Python {installation.python[0]}.{installation.python[1]}",
            rclpy,
            examination.middleware or "no middleware",
            "no valid domain" if examination.domain is None else f"domain {examination.domain}",
            f"discovery {examination.discovery_range}",
            *([f"messages through {_THROUGH[examination.path]}"] if examination.path else []),
        ]
    )


def diagnosis_lines(found: Diagnosis, *, colour: bool) -> Iterator[str]:
    """Yield a block: what is wrong, marked with its severity, then its impact and how to fix it."""
    mark, bold, dim, reset = (_MARK[found.severity], _BOLD, _DIM, _RESET) if colour else ("", "", "", "")
    first, *rest = found.what.splitlines()
    yield f"{mark}{found.severity.value:<{len(_INDENT)}}{reset}{bold}{printable(first)}{reset}"
    yield from (f"{_INDENT}{printable(line)}" for line in rest)
    if found.impact is not None:
        yield from _labelled("impact", found.impact, dim, reset)
    if found.fix is not None:
        yield from _labelled("fix", found.fix, dim, reset)


def _labelled(label: str, text: str, dim: str, reset: str) -> Iterator[str]:
    first, *rest = text.splitlines()
    yield f"{_INDENT}{dim}{label + ':':<8}{reset}{printable(first)}"
    yield from (f"{_INDENT}{'':8}{printable(line)}" for line in rest)


def observed_lines(observed: Observed) -> Iterator[str]:
    """Yield what was seen: a line of counts, a line for each topic of the file, then how its healthy groups fare."""
    graph = observed.graph
    nodes, topics = counted(len(graph.nodes), "other node"), counted(graph.n_topics, "published topic")
    yield f"observed for {observed.seconds:g} s: {nodes}, {topics}"
    places = {each.name: (report.facts, n) for report in observed.reports for n, each in enumerate(report.facts.inputs)}
    yield from aligned([_row(facts, index) for facts, index in places.values()])
    for report in observed.reports:
        yield from (f"  {report.facts.name}: {each.text}" for each in report.findings if each.code is Code.HEALTHY)


def _row(facts: GroupFacts, index: int) -> tuple[str, ...]:
    topic, lag = facts.inputs[index], facts.lag(index)
    rate_hz = topic.figures.rate_hz
    came = f"{rate_hz:.1f} Hz" if rate_hz else f"{topic.counts.fed} received"
    stamps = "" if lag is None else _age(lag)
    return topic.name, topic.type or "type not known yet", came, stamps, "; ".join(_publishers(topic)) or "no publisher"


def _age(delay: int) -> str:
    size = abs(delay)
    lasting = words.duration(size) if size < _LONG else words.seconds(size)
    return f"stamps {lasting} {'old' if delay >= 0 else 'ahead'}"


def _publishers(topic: InputFacts) -> Iterator[str]:
    for each in topic.graph.publishers:
        yield each.node if each.type == topic.type else f"{each.node} ({each.type})"


def verdict(diagnoses: Sequence[Diagnosis]) -> str:
    """Return the last line."""
    counts = Counter(each.severity for each in diagnoses)
    problems = [counted(counts[each], each.value) for each in (Severity.ERROR, Severity.WARNING) if counts[each]]
    hints = [f"{counts[Severity.INFO]} info"] if counts[Severity.INFO] else []
    return ", ".join([*(problems or ["no problems found"]), *hints])


def as_json(examination: Examination) -> dict[str, Any]:
    """Return what json.dumps takes."""
    installation, observed = examination.installation, examination.observed
    return {
        "ok": is_ok(examination),
        "python": f"{installation.python[0]}.{installation.python[1]}",
        "rclpy": installation.version,
        "middleware": examination.middleware or None,
        "domain": examination.domain,
        "discovery_range": examination.discovery_range,
        "receives_by": examination.path or None,
        "diagnoses": [{**asdict(each), "severity": each.severity.value} for each in examination.diagnoses],
        "graph": None if observed is None else {"seconds": observed.seconds, **asdict(observed.graph)},
        "groups": [] if observed is None else [group_of(report).as_dict() for report in observed.reports],
    }
