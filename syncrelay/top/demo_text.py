"""The demo as text: a line a second where nothing can be drawn, and the summary at the end."""

from dataclasses import dataclass
from itertools import chain
from typing import Final

from syncrelay.status.document import Group, Status
from syncrelay.top import phrases
from syncrelay.top.plain import group_lines

TITLE: Final = "syncrelay demo: camera, lidar and IMU simulated, relayed over DDS"


@dataclass(frozen=True, slots=True)
class Moment:
    """The relay's state as of its last report, `elapsed_s` after the start, of `total_s` if an end is set.

    `now` is the time, in nanoseconds of the clock that the rig stamps by.
    """

    state: Status
    elapsed_s: float
    total_s: float | None
    now: int


def plain_line(moment: Moment) -> str:
    """Return one line on all groups."""
    return f"{moment.elapsed_s:5.1f} s  {'; '.join(map(_in_short, moment.state.groups))}"


def _in_short(group: Group) -> str:
    if not group.rate_hz or group.span_ms is None:
        return f"{group.name}: {group.explanation.text if group.explanation else 'no set yet'}"
    rates = f"{phrases.sets_of_possible(group)} possible sets a second, span {phrases.duration(group.span_ms.p50)}"
    problems = ", ".join(problem.label for problem in group.problems)
    return f"{group.name}: {rates}{f' ({problems})' if problems else ''}"


def summary(moment: Moment) -> str:
    """Say at the end what became of every message and what the relay found, as `syncrelay top --once` does."""
    groups = chain.from_iterable(["", *group_lines(group)] for group in moment.state.groups)
    return "\n".join([f"{TITLE}: {moment.elapsed_s:.1f} s", *groups])
