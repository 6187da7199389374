"""Rigs that start after the relay, and publishers that come back: at no moment is their absence called something else.

What the graph shows changes before messages come, and both at any moment between two looks.
"""

import random
from typing import TypedDict

import pytest

from syncrelay.explain import Endpoint
from tests.explain.scenario import IMU, Source, Told, run
from tests.faults.extent import chosen

pytestmark = pytest.mark.long


class Calm(TypedDict):
    """Keywords of `Source`."""

    delay_ms: float
    delay_jitter_ms: float


TOPICS = ("/camera", "/lidar", "/imu")
CALM: Calm = {"delay_ms": 1.0, "delay_jitter_ms": 0.3}
SLOP = {"slop": "20ms"}


def shown(present):
    """What the graph shows of topics that have a publisher at `present(topic, second)`."""
    return lambda topic, second: (Endpoint(f"{topic}_driver", IMU),) if present(topic, second) else ()


def a_rig_that_starts_late(chance: random.Random, *, ppm: float = 0.0, slop: str = "20ms") -> Told:
    found = {topic: chance.uniform(0, 4.9) for topic in TOPICS}
    begins = {topic: found[topic] + chance.choice([0.1, 0.1, chance.uniform(0.1, 4)]) for topic in TOPICS}

    def source(topic: str) -> Source:
        drift = ppm if topic == "/lidar" else 0.0
        return Source(topic, 10, sends=lambda at: at >= begins[topic], clock=lambda at: -(at + 2) * drift / 1e6, **CALM)

    return run(
        *map(source, TOPICS),
        seconds=50,
        seed=chance.randrange(1000),
        options={"slop": slop},
        publishers=shown(lambda topic, second: second >= found[topic]),
    )


def a_lidar_that_returns(
    chance: random.Random, *, within: tuple[float, float] = (8, 40), is_killed: bool = False, ahead_s: float = 0.0
) -> Told:
    """Its next messages come a while after its publisher; who was killed stays in the graph for 20 s."""
    dies = chance.uniform(8, 20)
    returns = dies + chance.uniform(*within)
    begins = returns + chance.uniform(0.05, 4.5)
    gone = min(returns, dies + 20) if is_killed else dies + 0.1
    sources = [
        Source("/camera", 10, **CALM),
        Source("/lidar", 10, sends=lambda at: not dies <= at < begins, clock=lambda at: ahead_s * (at > dies), **CALM),
    ]
    is_there = shown(lambda topic, second: topic != "/lidar" or not gone <= second < returns)
    return run(*sources, seconds=80, seed=chance.randrange(1000), options=SLOP, publishers=is_there)


@pytest.mark.parametrize(("ppm", "slop"), [(10_000, "20ms"), (20_000, "20ms"), (1000, "20ms"), (200, "5ms")])
@pytest.mark.parametrize("seed", range(chosen(short=2, long=8)))
def test_a_clock_that_drifts_is_named_however_late_the_rig_starts(seed, ppm, slop):
    assert a_rig_that_starts_late(random.Random(seed), ppm=ppm, slop=slop).codes == {"clock_drift"}


@pytest.mark.parametrize("seed", range(chosen(short=5, long=20)))
def test_who_comes_back_is_not_blamed(seed):
    told = a_lidar_that_returns(random.Random(seed))
    assert told.codes == {"no_publisher"}
    assert any(line.text.startswith("recovered") for line in told.lines)


@pytest.mark.parametrize("seed", range(chosen(short=5, long=20)))
def test_who_was_killed_and_comes_back_is_not_blamed(seed):
    assert a_lidar_that_returns(random.Random(seed), is_killed=True).codes <= {"silent", "no_publisher"}


@pytest.mark.parametrize(
    ("ahead_s", "code"), [(-3, "other_clock"), (3, "other_clock"), (-0.45, "over_slop"), (0.06, "over_slop")]
)
@pytest.mark.parametrize("seed", range(chosen(short=3, long=10)))
def test_who_comes_back_with_another_clock_is_blamed_for_that_alone(seed, ahead_s, code):
    told = a_lidar_that_returns(random.Random(seed), within=(0.3, 8), ahead_s=ahead_s)
    assert told.codes - {"no_publisher"} == {code}
