"""What was late and is in time again: a backlog that ended, and no clock that was set."""

import random

import pytest

from syncrelay.explain import Code, Finding, GroupFacts
from tests.explain.scenario import S, Source, run
from tests.faults.extent import chosen


def told_of(*, lag: float, begin: float, end: float, lost: float, seconds: int = 60):
    """A camera late by `lag` for a while, of which the last messages are lost."""

    def received(second: float) -> float:
        return second + lag if begin <= second < end else second

    camera = Source("/camera", hz=15, received=received, sends=lambda second: not end - lost <= second < end)
    slow = Source("/gps", hz=1, delay_jitter_ms=1)
    return run(camera, slow, seconds=seconds, options={"slop": "40ms", "queue_size": 50})


@pytest.mark.parametrize("seed", range(chosen(short=5, long=60)))
def test_messages_that_are_in_time_again_are_no_step_of_a_clock(seed):
    chance = random.Random(seed)
    lag, begin = chance.uniform(0.5, 3), chance.uniform(10, 20)
    end, lost = begin + lag + chance.uniform(2, 15), lag + chance.uniform(0, 0.1)
    assert "clock_step" not in told_of(lag=lag, begin=begin, end=end, lost=lost).ever_found


def test_a_clock_that_is_set_back_and_forward_again_is_told_both_times():
    camera = Source("/camera", hz=15, clock=lambda second: -2.0 if 20 <= second < 30 else 0.0)
    steps: list[int] = []

    def hear(_second: float, facts: GroupFacts, found: tuple[Finding, ...], _remarks: object) -> None:
        stepped = facts.inputs[0].figures.stepped
        if stepped is not None and any(each.code is Code.CLOCK_STEP for each in found):
            steps.append(stepped.by)

    run(camera, Source("/gps", hz=10), Source("/imu", hz=30), seconds=50, options={"slop": "40ms"}, hears=hear)
    assert steps[0] == pytest.approx(-2 * S, rel=0.01)
    assert steps[-1] == pytest.approx(2 * S, rel=0.01)
