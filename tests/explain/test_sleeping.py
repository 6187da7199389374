"""What is said of a lazy group that sleeps and wakes, in virtual time: nothing but what is wrong while it is awake."""

from syncrelay.explain import Code, Endpoint
from tests.explain.scenario import IMU, Noise, Source, Told, run

REAL: Noise = {"jitter_ms": 1.0, "delay_jitter_ms": 2.0}


def lazy(*sources: Source, sleeps, seconds=120, **keys) -> Told:
    options = {"lazy": True, "slop": "30ms", **keys.pop("options", {})}
    return run(*sources, seconds=seconds, options=options, sleeps=sleeps, **keys)


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
