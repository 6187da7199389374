"""Rigs of which a known share of the possible sets leaves, in virtual time: how each view has its group stand.

The share is known from how a rig was drawn: a message of the pacemaker, the slowest input, has a partner or not. Each
test says in its failure which rig it was: `rig(seed)` draws it again.
"""

import random
from collections.abc import Callable
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import pytest

from syncrelay.explain import Severity, with_ok
from syncrelay.explain.standing import Pace, ShareWindow
from syncrelay.sync.counts import InputCounts
from tests.explain.scenario import BEGAN, S, Source, Told, run
from tests.faults.extent import IS_LONG

pytestmark = pytest.mark.long

_SECONDS = 110
# By then the start is over, and the pace of an input is known of which a part is not sent.
_SETTLED = 45


def held(told: Told) -> list[tuple[float, Severity]]:
    """At which second how bad a group's state was: what /status, /diagnostics, top, observe and doctor all show."""
    return [(second, max((each.severity for each in found), default=Severity.OK)) for second, found in told.found]


def changes(told: Told, *, since: float = _SETTLED) -> list[Severity]:
    return [level for level, _ in groupby(level for second, level in held(told) if second > since)]


@dataclass(frozen=True)
class Rig:
    """What was drawn. `share` is that of the possible sets that can leave."""

    seed: int
    share: float
    how: str
    sources: tuple[Source, ...]
    options: dict[str, Any]

    def play(self, seconds: int = _SECONDS) -> Told:
        return run(*self.sources, seconds=seconds, seed=self.seed, options=self.options)

    def __str__(self) -> str:
        rates = ", ".join(f"{each.topic} {each.hz:.3g} Hz" for each in self.sources)
        return f"seed {self.seed}: {self.share:.2f} of the sets, {self.how}, {rates}, {self.options}"


def rig(seed: int, least: float, most: float) -> Rig:
    """Draw a rig in which that share of the slowest input's messages comes and has a partner."""
    chance = random.Random(f"standing {seed}")
    hz = chance.choice([2.0, 5.0, 10.0, 20.0])
    others = [hz * chance.choice([1, 1, 2, 3, 5]) for _ in range(chance.choice([1, 1, 2]))]
    fastest = max(others)
    share = chance.uniform(least, most)
    options: dict[str, Any] = {"policy": chance.choice(["approximate_time", "approximate_time_eager", "latest_time"])}
    if options["policy"] == "latest_time":
        options |= {"trigger": "/lidar", "max_age": f"{1300 / min(others):.0f}ms"}
    else:
        options |= {"slop": f"{200 / fastest:.0f}ms", "queue_size": 30}
    how, kept, fault = _fault(share, hz, fastest, options["policy"], chance)
    moments = [kept(place / hz) for place in range(round(_SETTLED * hz), round(_SECONDS * hz))]
    noise = 20 / fastest
    sources = [Source("/lidar", hz, jitter_ms=noise, delay_jitter_ms=noise, delay_ms=20, **fault)]
    sources += [
        Source(f"/camera{place}", each, jitter_ms=noise, delay_jitter_ms=noise, phase_ms=-3 * noise)
        for place, each in enumerate(others)
    ]
    return Rig(seed, sum(moments) / len(moments), how, tuple(sources), options)


def _fault(
    share: float, hz: float, fastest: float, policy: str, chance: random.Random
) -> tuple[str, Callable[[float], bool], dict[str, Any]]:
    """Return which moments of the slowest input are kept, and what is wrong with the others.

    What is not sent can be missed only by an input of which most messages come at their pace.
    """
    salt = chance.random()
    patterns: dict[str, Callable[[float], bool]] = {
        "by chance": lambda second: random.Random(f"{salt} {round(second * hz)}").random() < share,
        "in order": lambda second: int(round(second * hz) * share) != int((round(second * hz) + 1) * share),
        "with pauses": lambda second: round(second * hz) % round(4 * hz) < share * 4 * hz,
    }
    faults: dict[str, dict[str, Any]] = {"unset": {}, "off": {}, "not sent": {}}
    if policy == "latest_time":
        # Whatever its stamps, a trigger finds the latest.
        del faults["off"]
    if share > 0.75 and hz < 10:
        # Of few messages, chance may keep any share in 10 s.
        del patterns["by chance"]
    pattern, fault = chance.choice([*patterns]), chance.choice([*faults])
    is_seen = {"by chance": share > 0.6, "in order": share > 0.7, "with pauses": share * 4 * hz > 12}
    if fault == "not sent" and not is_seen[pattern]:
        fault = "unset"
    kept = patterns[pattern]
    faults["unset"] = {"stamp": lambda stamp: stamp if kept((stamp - BEGAN) / S) else 0}
    faults["off"] = {"clock": lambda second: 0.0 if kept(second) else 0.5 / fastest}
    faults["not sent"] = {"sends": kept}
    return f"{fault} {pattern}", kept, faults[fault]


def _cases(count: int) -> list[int]:
    return list(range(count * 25 if IS_LONG else count // 7))


@pytest.mark.parametrize("seed", _cases(15))
def test_no_group_of_which_few_sets_leave_is_ever_well_or_recovered(seed):
    drawn = rig(seed, 0.1, 0.74)
    told = drawn.play()
    well = [second for second, level in held(told) if level is Severity.OK and second > _SETTLED]
    assert not well, f"{drawn}: well at {well}"
    # By chance, none of few may leave for 5 s.
    assert len(changes(told)) <= (3 if "chance" in drawn.how else 2), f"{drawn}: {changes(told)}"
    assert not [line.text for line in told.lines if "recovered" in line.text], str(drawn)


@pytest.mark.parametrize("seed", _cases(8))
def test_a_group_near_the_limit_does_not_come_and_go(seed):
    drawn = rig(seed, 0.76, 0.92)
    told = drawn.play()
    assert len(changes(told)) <= (3 if "chance" in drawn.how else 2), f"{drawn}: {changes(told)}"


@pytest.mark.parametrize("seed", _cases(8))
def test_of_a_healthy_group_nothing_is_said_however_many_frames_are_surplus(seed):
    drawn = rig(seed, 1, 1)
    told = drawn.play()
    assert told.lines == [], str(drawn)
    assert changes(told, since=0) == [Severity.OK], str(drawn)
    assert "healthy" in {each.code.value for each in with_ok(told.facts, told.found[-1][1])}, str(drawn)


@pytest.mark.parametrize(("hz", "every_s"), [(1.0, 30), (10.0, 12)])
def test_one_stray_set_changes_no_state_and_is_no_recovery(hz, every_s):
    camera = Source("/camera", hz)
    lidar = Source("/lidar", hz, clock=lambda second: 0.0 if round(second * hz) % (every_s * hz) == 0 else 0.4 / hz)
    told = run(camera, lidar, seconds=120, options={"slop": f"{100 / hz:.0f}ms"})
    assert told.facts.figures.sets >= 120 / every_s - 2
    assert changes(told) == [Severity.ERROR]
    assert not [line.text for line in told.lines if "recovered" in line.text]


@pytest.mark.parametrize("hz", [2.0, 10.0])
def test_recovered_is_said_once_the_share_is_back(hz):
    dead = Source("/lidar", hz, sends=lambda second: not 20 < second < 50)
    told = run(Source("/camera", 3 * hz), dead, seconds=90, options={"slop": f"{200 / hz:.0f}ms"})
    (recovered,) = [line for line in told.lines if "recovered" in line.text]
    # The window of a slow group is longer: it holds 30 possible sets.
    assert 50 + 0.9 * max(10, 30 / hz) < recovered.second <= 51 + max(10, 30 / hz)
    assert changes(told, since=45) == [Severity.ERROR, Severity.WARN, Severity.OK]


def test_a_share_is_measured_by_one_clock_alone():
    """A simulated clock that rests is not asked: the system's is 54 years ahead of it."""
    window = ShareWindow(lambda _: [0], trigger=None, ticks_hz=4.0)
    for second in range(20):
        counts = [InputCounts(second * 4, second * 4, {}, 0)]
        clock = None if second == 10 else (100 + second) * S
        window.add(counts, second * 4, [Pace(BEGAN, BEGAN + second * S, S // 4)], now=BEGAN + second * S, clock=clock)
        assert window.share().possible <= 4 * second
        assert window.share().ns <= second * S


@pytest.mark.parametrize("begin", [0.5, 2.3, 2.7, 2.95])
def test_sensors_that_begin_after_the_relay_owe_nothing_for_the_time_before(begin):
    sources = (Source(topic, 80, sends=lambda second: second >= begin) for topic in ("/camera", "/lidar"))
    told = run(*sources, seconds=12, options={"slop": "10ms"})
    assert told.ever_found == set()
    assert told.facts.figures.share.absent == 0
