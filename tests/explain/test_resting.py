"""What is said of a relay that is paused, and of a lazy group that sleeps: what is wrong while it works, alone."""

from syncrelay.explain import Code, Endpoint
from tests.explain.scenario import IMU, Noise, Source, Told, run

REAL: Noise = {"jitter_ms": 1.0, "delay_jitter_ms": 2.0}
_CAMERA = Source("/camera", hz=30, jitter_ms=2)
_SLOP = {"slop": "60ms"}


def test_a_silence_that_begins_in_a_pause_is_told_after_it():
    dead = Source("/lidar", hz=10, sends=lambda second: second < 40)
    told = run(_CAMERA, dead, seconds=90, options=_SLOP, paused=[(20, 60)])
    silent = told.findings("silent")
    assert all(each.severity.name == ("WARN" if second < 65 else "ERROR") for second, each in silent)
    assert {line.code for line in told.warnings} == {"silent"}
    in_the_pause, *after = told.warnings
    assert in_the_pause.second >= 45
    assert all(line.second >= 65 for line in after)
    assert not any("recovered" in line.text for line in told.lines)


def lazy(*sources: Source, sleeps, seconds=120, **keys) -> Told:
    options = {"lazy": True, "slop": "30ms", **keys.pop("options", {})}
    return run(*sources, seconds=seconds, options=options, sleeps=sleeps, **keys)


def test_what_happens_while_it_sleeps_is_no_news_when_it_wakes():
    """A driver is restarted at half its rate, and the clock of all sensors is set back by a minute."""

    def set_back(second: float) -> float:
        return -60 if second > 40 else 0

    slower = Source("/lidar", 10, hz_at=lambda second: 10 if second < 40 else 5, clock=set_back, **REAL)
    assert lazy(Source("/camera", 30, clock=set_back, **REAL), slower, sleeps=[(30, 60)]).lines == []


def test_who_is_not_there_is_told_though_nobody_listens():
    def publishers(topic: str, second: float) -> tuple[Endpoint, ...]:
        return () if topic == "/lidar" and second > 20 else (Endpoint(f"{topic}_driver", IMU),)

    told = lazy(Source("/camera", 30), Source("/lidar", 10), sleeps=[(10, 121)], publishers=publishers)
    assert [(each.second, each.code) for each in told.lines] == [(26, "no_publisher")]
    assert {each.code for each in told.found[-1][1]} >= {Code.NO_PUBLISHER, Code.NOBODY_LISTENS}
