"""The status of a relay as plain text: `top --once`, the service ~/status, what `observe` and `demo` print."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from textwrap import wrap
from typing import Final

from syncrelay.status import Level, advice
from syncrelay.status.document import Finding, Group, Input, Relay, Status
from syncrelay.top import phrases
from syncrelay.top.client import Answer

WIDTH: Final = 80
DEMO: Final = "syncrelay demo: camera, lidar and IMU simulated, relayed over DDS"


@dataclass(frozen=True, slots=True)
class Moment:
    """The state of the demo's relay as of its last report, `elapsed_s` after the start, of `total_s` if an end is set.

    `now` is the time, in nanoseconds of the clock that the rig stamps by.
    """

    state: Status
    elapsed_s: float
    total_s: float | None
    now: int


def line_of(moment: Moment) -> str:
    """Return one line on all groups of the demo."""
    return f"{moment.elapsed_s:5.1f} s  {'; '.join(map(_in_short, moment.state.groups))}"


def _in_short(group: Group) -> str:
    if not group.rate_hz or group.span_ms is None:
        return f"{group.name}: {group.explanation.text if group.explanation else 'no set yet'}"
    rates = f"{phrases.sets_of_possible(group)} possible sets a second, span {phrases.duration(group.span_ms.p50)}"
    problems = ", ".join(problem.label for problem in group.problems)
    return f"{group.name}: {rates}{f' ({problems})' if problems else ''}"


def summary_of(moment: Moment) -> str:
    """Return what became of every message of the demo and what its relay found, as `syncrelay top --once` shows it."""
    groups = chain.from_iterable(["", *group_lines(group)] for group in moment.state.groups)
    return "\n".join([f"{DEMO}: {moment.elapsed_s:.1f} s", *groups])


def plain_text(answer: Answer) -> str:
    """Return all of a status in lines of at most WIDTH columns; only words that are longer stick out."""
    relay = answer.status.relay
    lines = wrapped(answer.status.headline) + wrapped(
        f"{relay.node} {phrases.place(relay, answer.url)}: {_of_relay(relay)}"
    )
    for group in answer.status.groups:
        lines += ["", *group_lines(group)]
    return "\n".join(lines)


def summary(status: Status) -> str:
    """Return a line on all groups, one for the relay, and one for each group with the finding that explains most."""
    return "\n".join(
        [status.headline, f"{status.relay.node}: {_of_relay(status.relay)}", *map(_summary_of, status.groups)]
    )


def _summary_of(group: Group) -> str:
    finding = group.explanation
    if finding is None:
        return _of_group(group)
    # The finding `healthy` repeats the figures.
    state = _of_group(group) if finding.severity is not Level.OK else f"{group.name}: {group.level.name}"
    return "; ".join(filter(None, [state, finding.text, finding.suggestion]))


def _of_relay(relay: Relay) -> str:
    up = phrases.seconds(relay.uptime_s)
    needed = advice(relay.phase, relay.node)
    return "; ".join(
        filter(None, [f"{phrases.phase(relay)}, up {up}, syncrelay {relay.version}, {relay.config}", needed])
    )


def _of_group(group: Group) -> str:
    rate = f"{phrases.sets_of_possible(group)} possible sets a second, {phrases.last_set(group)}"
    return f"{group.name}: {group.level.name}, {rate}"


def group_lines(group: Group, *, width: int = WIDTH) -> Iterator[str]:
    """Yield all of a group in lines of at most `width` columns."""
    for text, indent in _of_group_in_full(group):
        yield from wrapped(text, indent=indent, width=width)


def _of_group_in_full(group: Group) -> Iterator[tuple[str, str]]:
    """Yield each sentence with its indent."""
    yield _of_group(group), ""
    yield phrases.options(group), "  "
    for name, sample in (("span", group.span_ms), ("latency", group.latency_ms)):
        if sample is not None:
            yield f"{name}: {phrases.percentiles(sample)}", "  "
    if effect := phrases.offsets(group):
        yield f"offset: {effect}", "  "
    for finding in group.findings:
        yield from _finding(finding)
    for each in group.inputs:
        yield from _input(each, group.problem_of(each))


def _finding(finding: Finding) -> Iterator[tuple[str, str]]:
    level = "" if finding.severity is Level.OK else f"{finding.severity.name}: "
    yield f"{level}{finding.text}", "  "
    if finding.suggestion:
        yield f"fix: {finding.suggestion}", "    "


def _input(each: Input, problem: Finding | None) -> Iterator[tuple[str, str]]:
    figures = [problem.label] if problem else []
    if each.rate_hz:
        figures.append(phrases.rate(each.rate_hz))
    if each.lag_ms is not None:
        figures.append(f"lag {phrases.duration(each.lag_ms)}")
    if each.jitter_ms is not None:
        figures.append(f"jitter {phrases.duration(each.jitter_ms)}")
    if each.dropped_lately:
        figures.append(f"dropped in the last 10 s: {phrases.drops_lately(each)}")
    optional = "" if each.required else " (optional)"
    yield f"{each.topic}{optional}: {', '.join(figures) or 'no message yet'}", "  "
    yield phrases.fates(each), "    "


def wrapped(text: str, *, indent: str = "", width: int = WIDTH) -> list[str]:
    """Return a text as lines of at most `width` columns; only words that are longer stick out."""
    return wrap(
        text,
        width,
        initial_indent=indent,
        subsequent_indent=f"{indent}  ",
        break_long_words=False,
        break_on_hyphens=False,
    )
