"""What is said of a lazy group that sleeps and wakes, in virtual time: nothing but what is wrong while it is awake."""

import pytest

from syncrelay.explain import Code, Endpoint
from tests.explain.scenario import IMU, Noise, Source, Told, run

REAL: Noise = {"jitter_ms": 1.0, "delay_jitter_ms": 2.0}
HEALTHY = {
    "camera and lidar": (
        [Source("/camera", 30, delay_ms=20, **REAL), Source("/lidar", 10, delay_ms=30, **REAL)],
        {"slop": "30ms"},
    ),
    "a slow one, and one that may be missing": (
        [Source("/imu", 100, delay_ms=2, **REAL), Source("/gps", 1, **REAL), Source("/extra", 10, required=False)],
        {"slop": "50ms", "queue_size": 250, "max_wait": "200ms"},
    ),
    "one that others are held for": (
        [Source("/lidar", 10, **REAL), Source("/pose", 2, **REAL)],
        {"policy": "latest_time", "trigger": "/lidar", "max_age": "1s"},
    ),
}
SLEEPS = {
    "once, for a minute": [(20, 80)],
    "from the start": [(0, 30)],
    "again and again": [(15, 20), (22, 30), (37, 38), (39, 70)],
    "to the end": [(60, 120)],
}


def lazy(*sources: Source, sleeps, seconds=120, **keys) -> Told:
    options = {"lazy": True, "slop": "30ms", **keys.pop("options", {})}
    return run(*sources, seconds=seconds, options=options, sleeps=sleeps, **keys)


def while_asleep(told: Told, sleeps) -> list[list[Code]]:
    """The codes of each second at which it slept."""
    return [[each.code for each in found] for second, found in told.found if any(a <= second < b for a, b in sleeps)]


@pytest.mark.parametrize(("sources", "options"), HEALTHY.values(), ids=HEALTHY)
@pytest.mark.parametrize("sleeps", SLEEPS.values(), ids=SLEEPS)
def test_of_a_healthy_rig_nothing_is_said_whenever_its_group_sleeps(sources, options, sleeps):
    told = run(*sources, seconds=120, options=options | {"lazy": True}, sleeps=sleeps)
    assert told.lines == []
    assert told.ever_found == set()
    asleep = while_asleep(told, sleeps)
    assert asleep
    assert all(Code.NOBODY_LISTENS in codes for codes in asleep)


def test_what_happens_while_it_sleeps_is_no_news_when_it_wakes():
    """A driver is restarted at half its rate, and the clock of all sensors is set back by a minute."""

    def set_back(second: float) -> float:
        return -60 if second > 40 else 0

    slower = Source("/lidar", 10, hz_at=lambda second: 10 if second < 40 else 5, clock=set_back, **REAL)
    assert lazy(Source("/camera", 30, clock=set_back, **REAL), slower, sleeps=[(30, 60)]).lines == []


def test_a_publisher_that_fell_silent_meanwhile_is_told_once_it_wakes():
    told = lazy(
        Source("/camera", 30, **REAL), Source("/lidar", 10, sends=lambda second: second < 40, **REAL), sleeps=[(30, 60)]
    )
    assert told.codes == {"silent"}
    assert 65 <= told.first.second <= 67


def test_a_silence_that_was_told_is_not_over_because_nobody_listens():
    told = lazy(
        Source("/camera", 30, **REAL),
        Source("/lidar", 10, sends=lambda second: not 20 < second < 70, **REAL),
        sleeps=[(30, 80)],
    )
    assert [each.code for each in told.lines] == ["silent"]


def test_a_warning_that_was_told_is_not_resolved_because_nobody_listens():
    told = lazy(
        Source("/camera", 30, **REAL),
        Source("/lidar", 10, hz_at=lambda second: 10 if second < 20 else 4, **REAL),
        sleeps=[(45, 90)],
    )
    assert [(each.code, each.warns) for each in told.lines] == [("slowed", True)]


def test_who_is_not_there_is_told_though_nobody_listens():
    def publishers(topic: str, second: float) -> tuple[Endpoint, ...]:
        return () if topic == "/lidar" and second > 20 else (Endpoint(f"{topic}_driver", IMU),)

    told = lazy(Source("/camera", 30), Source("/lidar", 10), sleeps=[(10, 121)], publishers=publishers)
    assert [(each.second, each.code) for each in told.lines] == [(26, "no_publisher")]
    assert {each.code for each in told.found[-1][1]} >= {Code.NO_PUBLISHER, Code.NOBODY_LISTENS}
