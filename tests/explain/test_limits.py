"""The limits that the pages and the comments of the rules name, found by bisection: to the nanosecond, or to the one.

Each is the first value, from one end on, at which something is so. Whatever moves a limit, or takes its very value to
the other side, moves that.
"""

from collections.abc import Callable
from typing import Any

import pytest

from syncrelay.clock import Step
from syncrelay.config import Tolerance
from syncrelay.explain import (
    Code,
    Distribution,
    Endpoint,
    Finding,
    FindingLog,
    Judge,
    Severity,
    Share,
    Standing,
    Standstill,
    judge,
    words,
)
from syncrelay.explain.cause_log import CauseLog
from syncrelay.explain.clocks import Drift
from syncrelay.explain.epochs import time_scale
from syncrelay.explain.finding_log import Remark
from syncrelay.explain.input_observation import InputObservation
from syncrelay.explain.rhythm import PaceWatch, bursts, steady_period
from syncrelay.explain.standing import StandingWatch
from syncrelay.explain.unneeded import DropFates
from syncrelay.sync.counts import InputCounts
from syncrelay.sync.messages import DropReason
from tests.explain.support.cases import AGES, LIDAR, STEADY, camera, dropped, overflowing, without_camera
from tests.explain.support.cases_flow import undelivered
from tests.explain.support.cases_stamps import AT_TICKS
from tests.explain.support.groups import BEGAN, IMAGE, MS, NOW, S, a_group, a_silent_group, an_input

IsSo = Callable[[int], bool]
TWO = Endpoint("/a", IMAGE), Endpoint("/b", IMAGE)
DAY = 86_400 * S
WARN, EXPIRED = Severity.WARN, DropReason.EXPIRED
NEW = {"flows_since": None}
UNSENT = {"counts": InputCounts(0, 0, {}, 0), "figures": {"last_received": None, "rate_hz": 0.0, "fed": 0}}
BURST = {"bursts": 1, "held": S}
BURSTING = camera(figures=BURST)
SLOW, LAX = Tolerance("slop", 3 * S), 3 * S + 5 * MS + 1
HELD = {**AGES, "trigger": 1}


def told(facts: Any, code: Code, text: str | Severity = "") -> bool:
    """Whether a finding is told, with some words, or as bad as that."""
    found = [each for each in judge(facts) if each.code is code]
    assert not any("None" in f"{each.text} {each.suggestion or ''}" for each in found)
    return any(each.severity is text if isinstance(text, Severity) else text in str(each) for each in found)


def codes(facts: Any) -> set[Code]:
    return {each.code for each in judge(facts)}


def seen(*, publishers: Any = TWO[:1], **figures: Any) -> Any:
    return a_group(camera(publishers=publishers, figures=figures), LIDAR)


def spans(over: int, of: int) -> dict[str, Any]:
    """Figures of sets of which so many are wider than slop."""
    measured = Distribution([5 * MS] * (of - over) + [30 * MS] * over)
    return {"nearest": measured, "nearest_since": measured}


def near_again(count: int) -> dict[str, Any]:
    """Figures of many sets that were wider than slop, and so many since that are not."""
    return {"nearest": Distribution([30 * MS] * 20 + [5 * MS] * count)}


def wide(*each: int) -> Any:
    return a_silent_group(figures={"nearest_since": Distribution(each)})


def silent(**figures: Any) -> Any:
    return a_silent_group(camera(figures={"rate_hz": 0.0, **figures}), LIDAR)


def silent_after(**facts: Any) -> IsSo:
    figures = facts.pop("figures", {})
    return lambda by: a_group(figures={"last_set": NOW - by, **figures}, **facts).is_silent


def began_within(by: int) -> bool:
    """Whether messages that begin so much later than their group count as there from the beginning."""
    began = NOW - 6 * S
    first = {"flows_since": began + by}
    return a_silent_group(camera(figures=first), LIDAR, figures={"began": began, "last_set": None}).had_time


def gone(by: int) -> Any:
    optional = camera(required=False, publishers=(), figures={"last_received": NOW})
    return a_group(LIDAR, optional, figures={"now": NOW + by, "last_set": NOW + by})


def rival(since: int) -> Any:
    return a_group(camera(rivals=TWO, rivals_since=since), LIDAR)


def quiet(by: int, *, sets: int = NOW - 7 * S, **figures: Any) -> Any:
    return a_group(camera(figures={"last_received": NOW - by, **figures}), LIDAR, figures={"last_set": sets})


def silent_both(by: int) -> Any:
    inputs = [
        an_input(name, figures={"rate_hz": 0.0, "last_received": at})
        for name, at in (("/camera", NOW - 9 * S), ("/lidar", NOW - 9 * S - by))
    ]
    return a_silent_group(*inputs)


def held_quiet(by: int) -> Any:
    """A group whose held input paused for 4 s at most, and has not come for longer."""
    figures = {"last_received": NOW - by, "longest_pause": 4 * S, "rate_hz": 0.0}
    return a_group(camera(figures=figures), LIDAR, **HELD)


def stood_still(ns: int, *, pause: int = 5 * S) -> Any:
    """A group of an input at 1 Hz that paused while the process stood still."""
    figures = {"usual_hz": 1.0, "longest_pause": pause, "last_received": NOW - S}
    return a_group(camera(figures=figures), LIDAR, standstills=(Standstill(NOW - 2 * S, ns),))


def held_up(hz: float) -> Any:
    """Two inputs that were held up together for 2 s, beside one of this rate."""
    both = {**BURST, "held": 2 * S, "held_up": [(NOW - 4 * S, NOW - 2 * S)]}
    return a_group(camera(figures=both), an_input("/lidar", figures=both), an_input("/imu", figures={"usual_hz": hz}))


def overflows(rate_hz: float, best_hz: float = 10.0) -> Any:
    return a_group(overflowing(40), LIDAR, figures={"rate_hz": rate_hz, "best_hz": best_hz})


def few(share: Share, **graph: Any) -> Any:
    return a_group(camera(**graph), LIDAR, figures={"share": share}, standing=Standing.FEW)


def late(by: int, **facts: Any) -> Any:
    return a_silent_group(camera(figures={"delay": by}), LIDAR, **facts)


def unset(count: int, group: Callable[..., Any]) -> Any:
    """A group of which so many of 100 messages have no stamp, and the sets are too wide."""
    return group(dropped(DropReason.UNSTAMPED, count), LIDAR, figures=spans(100, 100))


def stepped(by: int) -> Any:
    inputs = [an_input(name, figures={"stepped": Step(NOW - S, 3 * S + off)}) for name, off in (("/a", 0), ("/b", by))]
    return a_group(*inputs)


def drifts(slope: float, watched: int, *, bend: float = 0.0, doubt: float = 0.0) -> Any:
    drift = Drift(slope, bend, watched, doubt=doubt)
    return a_group(camera(figures={"drift": drift}), STEADY)


def without(text: str, **figures: Any) -> bool:
    """Whether this is said of an optional input of an age that no set leaves with."""
    near = {"delay": 5 * MS, "nearest": Distribution([3 * MS] * 100), **figures}
    return told(without_camera(**near), Code.WAITING_FOR_OPTIONAL, text)


def missing(share: float, since: int = 0) -> bool:
    figures = {"missing": (share, 0.0), "sets_since_without": (since, 100)}
    return told(a_group(camera(required=False), LIDAR, figures=figures), Code.WAITING_FOR_OPTIONAL)


def off_the_clock(*delays: int) -> Any:
    figures = [{"delay": each, "delays": (each,) * 20} for each in delays]
    return a_silent_group(camera(figures=figures[0]), an_input("/lidar", figures=figures[-1]), **AT_TICKS)


def at_ticks(max_wait: int = 0, **figures: Any) -> Any:
    came = {"delay": 305 * MS, "delays": (305 * MS,) * 20, "pace_hz": 10.0}
    ticks = {**AT_TICKS, "ticks_hz": 10.0, "max_wait": max_wait}
    return a_group(camera(figures=came), LIDAR, figures=figures, **ticks)


def still_too_wide(left: int) -> bool:
    """Whether sets that were too wide count as too wide while so many of 100 leave."""
    a_judge, half = Judge(), {**spans(50, 100), "share": Share(50, 100, 10 * S)}
    for _ in range(2):
        assert len(a_judge.judge(a_group(figures=half, standing=Standing.FEW))) == 1
    hardly = {**spans(3, 100), "share": Share(left, 100, 10 * S)}
    found = a_judge.judge(a_group(figures=hardly, standing=Standing.FEW))
    return Code.OVER_SLOP in {each.code for each in found if not each.is_over}


def says(*seconds: int, groups: int = 1, recovers: bool = False) -> list[int]:
    """At which of these moments the relay's log has a line about a silence of the first of some groups."""
    log, found, lines = CauseLog(), Finding(Code.SILENT, Severity.ERROR, "silent", input=0), []
    log.watch([f"g{n}" for n in range(groups)])
    for at in seconds:
        remark = Remark(Severity.OK, "recovered") if recovers and at else Remark(WARN, "silent", (found,))
        for n in range(1 if groups > 1 and not recovers else groups):
            if not recovers or (at < 2 and n >= at):
                log.hear(a_silent_group(name=f"g{n}"), (found,), [remark], now=DAY + at)
        lines += [at for _ in log.lines(now=DAY + at)]
    return lines


def warns(*seconds: int, severity: Severity = Severity.WARN, away: tuple[int, ...] = ()) -> list[int]:
    """At which of these moments, in nanoseconds after the first, the log has a line about one finding."""
    log, found = FindingLog(), Finding(Code.OVER_SLOP, severity, "too wide")
    lines = []
    for at in seconds:
        facts = a_group(figures={"now": NOW + at, "last_set": NOW + at, "began": NOW - DAY})
        lines += [at for _ in log.remarks(facts, () if at in away else (found,))]
    return lines


def stands(left: int, before: Standing = Standing.ENOUGH, of: int = 100) -> Standing:
    watch = StandingWatch()
    watch.now = before
    return watch.follow(Share(left, of, 10 * S), is_silent=False)


def flows_anew(pause: int, period: int = S // 10) -> bool:
    """Whether an input is said to flow since its last message, which came after a pause."""
    seen, last = InputObservation(), BEGAN + 19 * period
    seen.add([(at, at) for at in range(BEGAN, last + 1, period)])
    seen.add([(last + pause, last + pause)])
    return seen.figures(fed=0, dropped={}, seconds=1, now=last + pause).flows_since == last + pause


def fell_by(by: int) -> bool:
    seen = InputObservation()
    seen.add([(BEGAN, BEGAN), (BEGAN - by, BEGAN + 1)])
    return seen.figures(fed=0, dropped={}, seconds=1, now=BEGAN + 1).fell_by == by


def is_burst(held: int, period: int = 10 * MS) -> bool:
    """Whether messages that come at once after being held up so long are a burst."""
    came = [(n * period, n * period) for n in range(20)]
    last = 19 * period
    stamps = [last + period * n for n in range(1, 5)]
    return bool(list(bursts([*came, *((each, last + period + held + n) for n, each in enumerate(stamps))])))


def slowed(*periods: int, known: int = 21) -> bool:
    """Whether an input that has sent with each of these periods has slowed, `known` messages with the last of them."""
    pace = PaceWatch()
    for count, each in zip((*[21] * (len(periods) - 1), known), periods, strict=True):
        pace.observe([BEGAN + n * each for n in range(count)], 1)
    return pace.slowed_from is not None


def rates(count: int, fed: int) -> tuple[float, float]:
    """The rate in a window that held so many messages, and the usual one, of an input that has sent some at 1 Hz."""
    seen, last = InputObservation(), BEGAN + count * S
    seen.add([(at, at) for at in range(BEGAN + S, last + 1, S)])
    figures = seen.figures(fed=fed, dropped={}, seconds=0.5, now=last)
    return figures.rate_hz, figures.usual_hz


def lossy(**facts: Any) -> Any:
    return undelivered(12, 4, figures={"pace_hz": 2.0, "slowed_from_hz": 10.0}, **facts)


def is_steady(*periods: int) -> bool:
    at = BEGAN
    return steady_period([at, *(at := at + each for each in periods)]) is not None


# From one end, where it is not so, to the other, where it is: the first value at which it is so.
# Most are about as long, and no more.
_UNEVEN = [8, 9, 10, 11, 12] * 8
LIMITS: dict[str, tuple[int, int, int, IsSo]] = {
    # A group is silent after 5 s, or after three sets that should have come.
    "silent after 5 s": (0, 60 * S, 5 * S, silent_after()),
    "silent after three sets": (0, 60 * S, 30 * S, silent_after(figures={"best_hz": 0.1})),
    "silent after three sets that may leave": (0, 60 * S, 12 * S, silent_after(least_period=4 * S)),
    "silent after a pause": (0, 60 * S, 5 * S, lambda by: a_silent_group(unpaused=NOW - by).is_silent),
    "had time": (0, 60 * S, 5 * S, lambda by: silent(flows_since=NOW - by).had_time),
    "there at the beginning": (4 * S, 0, 2 * S, began_within),
    "new": (60 * S, 0, 10 * S - 1, lambda by: a_silent_group(camera(served_since=NOW - by, figures=NEW), LIDAR).is_new),
    # What the graph and the arrivals tell.
    "an optional input is away as usual": (0, 90 * S, 60 * S, lambda by: not told(gone(by), Code.NO_PUBLISHER, WARN)),
    "another relay does not end": (0, 9 * S, 3 * S, lambda by: told(rival(NOW - by), Code.OUTPUT_TAKEN)),
    "about to send": (0, 9 * S, 5 * S, lambda by: told(a_group(camera(**UNSENT, served_since=NOW - by)), Code.SILENT)),
    "silent by its rate": (0, 9 * S, 5 * S, lambda by: told(quiet(by, sets=NOW, rate_hz=0.0), Code.SILENT)),
    "silent as long as the group": (0, 9 * S, 5600 * MS, lambda by: told(quiet(by, sets=NOW - 7 * S), Code.SILENT)),
    "silent for two periods": (0, 20 * S, 8 * S + 1, lambda by: told(quiet(by, usual_hz=0.25), Code.SILENT)),
    "in the graph without a lease": (0, 60 * S, 20 * S + 1, lambda by: told(quiet(by), Code.SILENT, "still publishes")),
    "silent together": (9 * S, 0, 2 * S - 1, lambda by: told(silent_both(by), Code.SILENT, "all inputs")),
    "no pause of what is held": (0, 20 * S, 12 * S, lambda by: told(held_quiet(by), Code.SILENT)),
    # The flow.
    "waited for the relay": (0, S, 500 * MS, lambda by: told(a_group(waited=by), Code.TOO_SLOW)),
    "stood still": (0, S, 500 * MS, lambda by: told(stood_still(by), Code.TOO_SLOW)),
    "a pause that a rate explains": (0, 9 * S, 3 * S + 1, lambda by: told(stood_still(2 * S, pause=by), Code.TOO_SLOW)),
    "who would show a burst": (50, 0, 24, lambda hz: told(held_up(hz / 10), Code.BURSTS, "all inputs")),
    "sent as before": (0, 20, 9, lambda hz: not told(a_group(lossy(sent_hz=float(hz))), Code.SLOWED)),
    "given up by a history": (12, 0, 5, lambda n: told(a_group(lossy(lost=n)), Code.MESSAGES_LOST, "replaced them")),
    "losses are the cause": (1, 99, 50, lambda n: Code.FEW_SETS not in codes(few(Share(0, 100, 10 * S), lost=n))),
    # Stamps: of another clock, unset, repeated, falling, drifting.
    "another clock": (0, 5 * S, S + 5 * MS + 1, lambda by: told(late(by), Code.OTHER_CLOCK)),
    "another clock ahead": (0, -5 * S, 5 * MS - S - 1, lambda by: told(late(by), Code.OTHER_CLOCK)),
    "another clock than slop": (0, 9 * S, LAX, lambda by: told(late(by, tolerance=SLOW), Code.OTHER_CLOCK)),
    "another clock than a wait": (0, 9 * S, LAX, lambda by: told(late(by, waited=1500 * MS), Code.OTHER_CLOCK)),
    "off the clock that triggers": (0, 5 * S, S + 1, lambda by: told(off_the_clock(by), Code.OTHER_CLOCK)),
    "all are off": (9 * S, 0, S - 1, lambda by: told(off_the_clock(9 * S, 9 * S + by), Code.OTHER_CLOCK, "input=None")),
    "ahead of the clock that triggers": (0, -5 * S, -S - 1, lambda by: told(off_the_clock(by), Code.OTHER_CLOCK)),
    "unset are most": (1, 100, 50, lambda n: told(unset(n, a_silent_group), Code.UNSTAMPED, Severity.ERROR)),
    "unset are why": (1, 100, 2, lambda n: Code.OVER_SLOP not in codes(unset(n, a_group))),
    "unset are why none leaves": (1, 100, 50, lambda n: Code.OVER_SLOP not in codes(unset(n, a_silent_group))),
    "disorder": (0, 9, 2, lambda n: told(seen(out_of_order=n), Code.OUT_OF_ORDER)),
    "repeated stamps": (0, 9, 2, lambda n: told(seen(duplicates=n), Code.DUPLICATES)),
    "disorder of two": (0, 9, 2, lambda n: told(seen(publishers=TWO, out_of_order=n), Code.SEVERAL_PUBLISHERS)),
    "two clocks of two": (0, 9, 2, lambda n: told(seen(publishers=TWO, swings=n), Code.SEVERAL_PUBLISHERS)),
    "two clocks of one": (0, 9, 2, lambda n: told(seen(swings=n), Code.TIME_JUMP, "back and forth")),
    "fell lately": (60 * S, 0, 30 * S - 1, lambda by: told(seen(fell_by=S, fell_at=NOW - by), Code.TIME_JUMP)),
    "stepped alike": (2 * S, 0, S - 1, lambda by: told(stepped(by), Code.CLOCK_STEP, "all inputs")),
    "drifted by 5 ms": (0, 60 * S, 50 * S, lambda by: told(drifts(0.000_1, by), Code.CLOCK_DRIFT)),
    "drifts for 8 s": (0, 60 * S, 8 * S, lambda by: told(drifts(0.001, by), Code.CLOCK_DRIFT)),
    "drifts as oscillators do": (9000, 1000, 2250, lambda ppm: told(drifts(ppm * 1e-6, 60 * S), Code.CLOCK_DRIFT)),
    "drifts along a line": (9 * MS, 0, 750_000, lambda by: told(drifts(0.000_1, 60 * S, bend=by), Code.CLOCK_DRIFT)),
    "drifts for certain": (120, 0, 100, lambda ppm: told(drifts(1e-4, 60 * S, doubt=ppm * 1e-6), Code.CLOCK_DRIFT)),
    "fell in the input": (0, 9 * S, S + 1, fell_by),
    # How stamps match.
    "over slop": (0, 60 * MS, 20 * MS + 1, lambda by: told(wide(*[by] * 9), Code.OVER_SLOP)),
    "enough to tell": (0, 9, 3, lambda n: told(wide(*[60 * MS] * n), Code.OVER_SLOP)),
    "all over slop": (0, 100, 96, lambda n: told(wide(*[60 * MS] * n, *[MS] * (100 - n)), Code.OVER_SLOP)),
    "some over slop": (0, 100, 10, lambda n: told(a_group(figures=spans(n, 100)), Code.OVER_SLOP)),
    "more than chance": (0, 20, 3, lambda n: told(a_group(figures=spans(n, 20)), Code.OVER_SLOP)),
    "near again": (0, 20, 3, lambda n: not told(a_group(figures=near_again(n)), Code.OVER_SLOP)),
    "most over slop": (0, 100, 51, lambda n: told(a_group(BURSTING, LIDAR, figures=spans(n, 100)), Code.OVER_SLOP)),
    "a queue too short": (0, 99, 11, lambda n: told(a_silent_group(overflowing(n), LIDAR), Code.SHORT_QUEUE)),
    "missed for a queue": (1000, 0, 949, lambda hz: told(overflows(hz / 100), Code.SHORT_QUEUE)),
    "missed of few for a queue": (200, 0, 179, lambda hz: told(overflows(hz / 100, 2.0), Code.SHORT_QUEUE)),
    "sets to tell that few leave": (0, 99, 10, lambda n: told(few(Share(1, n, 10 * S)), Code.FEW_SETS)),
    "mostly not needed": (99, 0, 49, lambda n: bool(DropFates({EXPIRED: 100}, {EXPIRED: n}).mostly_unneeded)),
    "missing in sets": (0, 1000, 70, lambda n: missing(n / 1000)),
    "back in sets": (99, 0, 5, lambda n: missing(0.5, since=n)),
    "away": (0, 9 * S, S + 1, lambda by: without("been silent", last_received=NOW - by)),
    "away by its rate": (0, 9 * S, 3 * S + 1, lambda by: without("been silent", last_received=NOW - by, usual_hz=1.0)),
    "of another clock": (0, 9 * S, S + 5 * MS + 1, lambda by: without("its stamps are", delay=by)),
    "of another clock, ahead": (0, -5 * S, 5 * MS - S - 1, lambda by: without("ahead of", delay=by)),
    "far from all": (0, 60 * MS, 20 * MS + 1, lambda by: without("the nearest sets", nearest=Distribution([by] * 9))),
    "enough to be far": (0, 9, 5, lambda n: without("the nearest sets", nearest=Distribution([60 * MS] * n))),
    "too late": (0, 900 * MS, 105 * MS + 1, lambda by: without("too late", delay=by)),
    "pauses": (0, 40, 21, lambda n: told(few(Share(60, 100, 10 * S, 0, absent=n)), Code.FEW_SETS, "did not come")),
    "too old at ticks": (0, 60 * S, 10 * S, lambda by: told(at_ticks(began=NOW - by, rate_hz=5.0), Code.OVER_SLOP)),
    "too few at ticks": (1000, 0, 949, lambda hz: told(at_ticks(rate_hz=hz / 100), Code.OVER_SLOP)),
    "too old but for a wait": (S, 0, 205 * MS - 1, lambda by: told(at_ticks(by, rate_hz=5.0), Code.OVER_SLOP)),
    "too wide until": (100, 0, 94, still_too_wide),
    # How a group stands, by the percent of its sets that leave.
    "few": (100, 0, 79, lambda n: stands(n) is Standing.FEW),
    "enough again": (0, 100, 95, lambda n: stands(n, Standing.FEW) is Standing.ENOUGH),
    "not none any more": (0, 79, 50, lambda n: stands(n, Standing.NONE) is Standing.FEW),
    "enough after a silence": (0, 100, 80, lambda n: stands(n, Standing.NONE) is Standing.ENOUGH),
    "few of 10": (10, 5, 6, lambda n: stands(n, of=10) is Standing.FEW),
    "few of 14": (14, 5, 10, lambda n: stands(n, of=14) is Standing.FEW),
    "possible sets to tell": (0, 99, 10, lambda n: Share(0, n, 10 * S).value is not None),
    # The log.
    "a warning lasts": (0, 60 * S, 5 * S, lambda by: warns(0, by) == [by]),
    "a warning is news": (6 * S, 99 * S, 71 * S + 1, lambda by: len(warns(0, 5 * S, 11 * S, by, by + 5 * S)) == 2),
    "a warning is over": (6 * S, 99 * S, 15 * S, lambda by: warns(0, 5 * S, by, away=(by,)) == [5 * S, by]),
    "a line is repeated": (0, 59 * S, 4 * S, lambda by: says(0, by) == [0, by]),
    "a line is forgotten": (76 * S, 150 * S, 135 * S, lambda by: by in says(0, 5 * S, 15 * S, 35 * S, 75 * S, by)),
    "a line waits for all groups": (0, 9 * S, 5 * S, lambda by: says(0, by, groups=2) == [by]),
    "a line waits for all": (2, 90 * S, 30 * S + 1, lambda by: by in says(0, 1, by, groups=2, recovers=True)),
    # The rhythm of arrivals.
    "a silence of 5 s": (0, 9 * S, 5 * S + 1, flows_anew),
    "a silence of five periods": (0, 60 * S, 10 * S + 1, lambda by: flows_anew(by, 2 * S)),
    "held up": (0, S, 500 * MS, is_burst),
    "held up for three periods": (0, 2 * S, 900 * MS, lambda by: is_burst(by, 300 * MS)),
    "slowed": (0, S, 142_857_143, lambda by: slowed(*[100 * MS] * 9, by)),
    "slowed again": (0, S, 142_857_143, lambda by: slowed(*[100 * MS] * 20, *[300 * MS] * 9, *[100 * MS] * 3, by)),
    "slowed until": (S, 100 * MS, 117_647_058, lambda by: not slowed(*[100 * MS] * 9, 200 * MS, by)),
    "slowed, and stamps begin anew": (0, 21, 9, lambda n: not slowed(*[100 * MS] * 9, 200 * MS, 100 * MS, known=n)),
    "steady for so long": (0, 9, 6, lambda n: slowed(*[100 * MS] * n, S)),
    "steady": (10 * MS, 100 * MS, 66_666_667, lambda by: slowed(*[100 * MS] * 5, *[by] * 4, S)),
    "steady but for": (9, 0, 2, lambda n: slowed(*[100 * MS] * (20 - n), *[10 * MS] * n, S)),
    "rate of a window": (0, 9, 5, lambda n: rates(20, n)[0] == 2 * n),
    "rate of messages": (0, 9, 5, lambda n: rates(n, n)[1] > 0),
    "periods to tell": (0, 40, 4, lambda n: is_steady(*[10 * MS] * n)),
    "periods to tell of any": (0, 40, 18, lambda n: is_steady(*[MS * each for each in _UNEVEN[:n]])),
    "whole multiples": (5 * MS, 0, 564_842, lambda by: is_steady(*[10 * MS] * 4, *[20 * MS + by] * 3)),
    "one at least": (0, 5 * MS, 4_524_839, lambda by: is_steady(*[by] * 4, 5 * MS, *[10 * MS] * 12)),
    "about as long": (0, 10 * MS, 7_500_000, lambda by: is_steady(*[by] * 8, *[10 * MS] * 15, *[25 * MS] * 8)),
    "no longer": (20 * MS, 10 * MS, 12_500_000, lambda by: is_steady(*[MS] * 8, *[10 * MS] * 15, *[by] * 8)),
    "most about as long": (10, 20, 11, lambda n: is_steady(*[10 * MS] * n, *[25 * MS] * (20 - n))),
    "hardly any longer": (0, 9, 3, lambda n: not is_steady(*[10 * MS] * (21 - n), *[99 * MS] * n)),
    "hardly longer": (99 * MS, 0, 40 * MS, lambda by: is_steady(*[10 * MS] * 18, *[by] * 3)),
    "at once": (0, 9 * MS, MS, lambda by: is_steady(*[by] * 20)),
    # How they are read.
    "minutes": (0, 999 * S, 100 * S, lambda by: words.seconds(by).endswith("min")),
    "hours": (0, 99_999 * S, 6000 * S, lambda by: words.seconds(by).endswith("h")),
    "whole seconds": (9 * S, 9999 * MS, 9950 * MS, lambda by: words.seconds(by) == "10 s"),
    "any minutes": (0, 999 * S, 100 * S, lambda by: words.span_of_time(by).endswith("min")),
    "days": (0, 9 * DAY, 2 * DAY, lambda by: words.span_of_time(by).endswith("days")),
    "years": (0, 999, 730, lambda days: words.span_of_time(days * DAY).endswith("years")),
    "milliseconds": (0, 9 * MS, 999_500, lambda by: words.duration(by).endswith("ms")),
    "one digit less": (0, 100_000, 99_950, lambda n: words.figure(n / 1000) == "100"),
    "two digits": (0, 10_000, 9_995, lambda n: words.figure(n / 1000) == "10"),
    "a percent": (0, 14, 10, lambda n: words.share(n / 1000) == "1 %"),
    # The time scales.
    "GPS time": (99 * S, 0, 30 * S - 1, lambda by: time_scale(BEGAN, 315_964_800 * S + by) is not None),
    "TAI": (9 * S, 0, S // 2 - 1, lambda by: time_scale(BEGAN, by - 37 * S) is not None),
    "GPS time with 18 s": (9 * S, 0, S // 2 - 1, lambda by: time_scale(BEGAN, by - 18 * S) is not None),
    "a time zone": (9 * S, 0, S - 1, lambda by: time_scale(BEGAN, 3600 * S + by) is not None),
    "the last time zone": (99, 1, 28, lambda n: time_scale(BEGAN, 1800 * S * n) is not None),
    "since boot": (400 * DAY, 1, 365 * DAY - 1, lambda at: time_scale(at, 366 * DAY) is not None),
    "behind since boot": (0, 999 * DAY, 365 * DAY + 1, lambda by: time_scale(S, by) is not None),
}


@pytest.mark.parametrize(("never", "ever", "first", "is_so"), LIMITS.values(), ids=LIMITS)
def test_something_is_so_from_its_limit_on(never: int, ever: int, first: int, is_so: IsSo):
    assert is_so(ever)
    assert not is_so(never)
    while abs(ever - never) > 1:
        middle = (ever + never) // 2
        if is_so(middle):
            ever = middle
        else:
            never = middle
    assert ever == first
