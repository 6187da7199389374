"""What the log says first, and what it never says, of rigs in virtual time: one cause each, and its many effects."""

from collections.abc import Callable
from functools import partial
from typing import Any

import pytest

from syncrelay.explain import ClockState, Endpoint, Step
from tests.explain.scenario import IMU, Noise, Source, Told, run
from tests.explain.support.groups import S
from tests.faults.extent import chosen

REAL: Noise = {"jitter_ms": 1.0, "delay_jitter_ms": 2.0}
SLOP = {"slop": "20ms"}


def a_pair(*, seconds=60, options=SLOP, more=None, **faults) -> Told:
    """Two inputs at 10 Hz; the second has the faults."""
    sources = Source("/a", 10, **REAL), Source("/b", 10, **{**REAL, **faults})
    return run(*sources, seconds=seconds, options=options, **(more or {}))


def all_of(*, seconds=60, more=None, **faults) -> Told:
    """Two inputs with the same faults."""
    sources = (Source(topic, 10, **{**REAL, **faults}) for topic in ("/a", "/b"))
    return run(*sources, seconds=seconds, options=SLOP, **(more or {}))


def facts(of: Callable[[float], dict[str, Any]]) -> dict[str, Any]:
    """The keyword of `run` that adds what else is known at a second."""
    return {"facts": of}


def shown(of: Callable[[float], tuple[Endpoint, ...]]) -> dict[str, Any]:
    """The keyword of `run` that has the graph show these publishers of /b at a second."""
    return {"publishers": lambda topic, second: of(second) if topic == "/b" else (Endpoint("/a_driver", IMU),)}


IMAGES = Endpoint("/stranger", "sensor_msgs/msg/Image")
UNTYPED = {"topic_options": {"type": None}}

# What is told, the code of its cause, the topics that this is about. tests/bank draws many more.
CAUSES: dict[str, tuple[Callable[[], Told], str, tuple[str, ...]]] = {
    "both inputs drift": (
        lambda: run(
            Source("/a", 10, clock=lambda second: 0.001 * second, **REAL),
            Source("/b", 10, clock=lambda second: -0.001 * second, **REAL),
            seconds=60,
            options=SLOP,
        ),
        "clock_drift",
        (),
    ),
    "one publisher stamps by two clocks": (
        lambda: a_pair(stamp=lambda stamp: stamp - 3 * S * (stamp // 100_000_000 % 2)),
        "time_jump",
        ("/b",),
    ),
    "there is no clock": (
        lambda: all_of(
            more=facts(lambda second: {"clock": ClockState(received=False, stopped=round(second * S))}), seconds=30
        ),
        "no_clock",
        (),
    ),
    "a simulation is paused": (
        lambda: all_of(
            sends=lambda second: second < 20,
            more=facts(
                lambda second: {
                    "clock": ClockState(received=True, stopped=round((second - 20) * S) if second > 23 else None)
                }
            ),
        ),
        "clock_stopped",
        (),
    ),
    **{
        f"the clock of all inputs steps by {by} s": (
            partial(all_of, clock=lambda second, by=by: 0.0 if second < 20 else by),
            "clock_step",
            (),
        )
        for by in (2.0, -2.0)
    },
    "this machine's clock is set": (
        lambda: a_pair(more=facts(lambda at: {"clock_set": Step(1_700_000_020 * S, 2 * S) if 20 <= at < 50 else None})),
        "clock_step",
        (),
    ),
    "a recorder pauses": (
        lambda: all_of(
            sends=lambda second: not 20 < second < 35, more=facts(lambda _: {"is_recorded": True}), seconds=80
        ),
        "silent",
        ("/a", "/b"),
    ),
    "one message comes, and no other": (lambda: a_pair(sends=lambda second: second < 0.05), "silent", ("/b",)),
    "a publisher returns with another type than was taken": (
        lambda: a_pair(
            sends=lambda second: second < 20,
            more=shown(lambda second: (IMAGES if second > 20 else Endpoint("/b_driver", IMU),)),
            **UNTYPED,
        ),
        "other_type",
        ("/b",),
    ),
    # At 4 Hz, half of the messages come between two sweeps of the lidar.
    **{
        f"an optional input of {hz} Hz comes after {delay_ms} ms": (
            partial(
                run,
                *(Source("/camera", 20), Source("/lidar", 10), Source("/gps", hz, delay_ms=delay_ms, required=False)),
                seconds=30,
                options={"slop": "40ms", "max_wait": "60ms"},
            ),
            "waiting_for_optional",
            ("/gps",),
        )
        for hz, delay_ms in ((2, 200), (4, 5))
    },
    "a topic without a type has two": (
        lambda: a_pair(
            sends=lambda second: second > 30,
            more=shown(lambda second: (Endpoint("/b_driver", IMU), IMAGES)[: 2 if second < 30 else 1]),
            **UNTYPED,
        ),
        "several_types",
        ("/b",),
    ),
}


@pytest.mark.parametrize(("told_of", "code", "topics"), CAUSES.values(), ids=CAUSES)
def test_only_the_cause_is_said(told_of, code, topics):
    told = told_of()
    assert told.says_only(code, *topics), told.warnings
    # A silence is said again after 10, 20 and 40 s.
    assert len(told.warnings) <= 4


def test_a_step_that_stays_is_another_clock_in_the_end():
    told = a_pair(clock=lambda second: 0.0 if second < 20 else 2.0, seconds=80)
    assert [line.code for line in told.warnings][-1] == "other_clock"
    assert told.codes == {"clock_step", "other_clock"}


@pytest.mark.parametrize("seed", range(chosen(short=1, long=20)))
@pytest.mark.parametrize(
    "late", [Source("/gps", 1, delay_ms=80, delay_jitter_ms=30), Source("/camera", 5, delay_ms=700, delay_jitter_ms=60)]
)
def test_a_delay_that_varies_is_no_drift(late, seed):
    told = run(Source("/imu", 100), late, seconds=60, seed=seed, options={"slop": "10ms", "queue_size": 200})
    assert told.ever_found == set()


@pytest.mark.parametrize("slower", [1.0, 0.5])
def test_what_comes_in_batches_has_the_pace_of_its_stamps(slower):
    told = all_of(
        hz_at=lambda second: 10 if second < 30 else 10 * slower, received=lambda second: second - second % 1.2 + 1.2
    )
    assert bool(told.findings("slowed")) == (slower < 1)
    for each in told.facts.inputs if slower < 1 else ():
        assert each.figures.slowed_from_hz == pytest.approx(10, rel=0.1)
        assert each.figures.pace_hz == pytest.approx(5, rel=0.2)


@pytest.mark.parametrize("rest_s", [0.0, 0.8])
@pytest.mark.parametrize("again_s", [20.4, 23.2])
def test_what_is_sent_again_after_a_standstill_is_missed_because_of_it(again_s, rest_s):
    def received(at: float) -> float:
        return again_s if 17 < at < again_s else at

    told = run(
        *(Source(topic, 10, received=received, **REAL) for topic in ("/a", "/b")),
        seconds=60,
        options=SLOP,
        stops=[(17.1, 20.1)],
        rest_s=rest_s,
    )
    assert told.ever_found <= {"too_slow"}
    assert told.codes == {"too_slow"}


def test_sets_that_leave_by_chance_put_off_no_advice():
    pair = Source("/a", 10, jitter_ms=0.2, delay_jitter_ms=0.3), Source("/b", 10, jitter_ms=0.3, delay_jitter_ms=0.3)
    told = run(*pair, seconds=30, options={"slop": "20us"})
    late = [line.text for line in told.lines if line.second > 20]
    assert late
    assert not [text for text in late if "wait some seconds" in text]
