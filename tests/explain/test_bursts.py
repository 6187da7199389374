"""What is a burst, and what only looks like one."""

import random
from collections import deque

import pytest

from syncrelay.explain.input_observation import InputObservation
from syncrelay.explain.rhythm import Burst, bursts
from tests.explain.support.groups import MS, S


def _stream(first, last, *, period=10 * MS, delay=MS):
    return [(stamp, stamp + delay) for stamp in range(first, last, period)]


def _held(first, last, *, period=10 * MS):
    """Messages of a stretch of time that all come at its end."""
    return [(stamp, last + n * MS // 10) for n, stamp in enumerate(range(first, last, period))]


def test_messages_that_come_at_once_after_a_pause_are_a_burst():
    arrivals = _stream(S, 2 * S) + _held(2 * S, 3 * S) + _stream(3 * S + 20 * MS, 4 * S)
    assert list(bursts(arrivals)) == [Burst(3 * S, 999 * MS)]


def test_every_burst_is_found():
    arrivals = [each for second in range(1, 5) for each in _held(second * S, (second + 1) * S)]
    assert [burst.at for burst in bursts(arrivals)] == [3 * S, 4 * S, 5 * S]


@pytest.mark.parametrize(
    "arrivals",
    [
        pytest.param([], id="nothing"),
        pytest.param([(S, S)], id="one message"),
        pytest.param(_stream(S, 9 * S), id="an even stream"),
        pytest.param(_stream(S, 2 * S) + _stream(5 * S, 6 * S), id="a publisher that paused"),
        pytest.param(_stream(S, 2 * S) + _held(2 * S, 2 * S + 400 * MS) + _stream(3 * S, 4 * S), id="too short a time"),
        pytest.param(_stream(S, 2 * S) + _stream(2 * S, 4 * S, delay=2 * S), id="late from now on"),
        pytest.param(
            [*_stream(S, 20 * S, period=S), (20 * S, 22 * S), *_stream(23 * S, 30 * S, period=S)],
            id="one message that took longer",
        ),
        pytest.param(
            [*_stream(S, 3 * S, period=100 * MS), (3700 * MS, 4400 * MS), *_stream(4500 * MS, 9 * S, period=100 * MS)],
            id="a node that once took long and skipped the others",
        ),
        pytest.param(
            sorted(_stream(S, 4 * S) + _stream(S, 4 * S, delay=800 * MS), key=lambda arrival: arrival[1]),
            id="two publishers, one of them late",
        ),
    ],
)
def test_no_burst(arrivals):
    assert list(bursts(arrivals)) == []


@pytest.mark.parametrize("seed", range(20))
def test_a_burst_is_found_once_whenever_the_looks_are(seed):
    chance = random.Random(seed)
    left = _stream(S, 2 * S, period=50 * MS) + _held(2 * S, 3 * S, period=50 * MS) + _stream(3 * S + 20 * MS, 5 * S)
    seen = InputObservation()
    while left:
        size = chance.randint(1, 20)
        came, left = left[:size], left[size:]
        seen.add(deque(came))
    figures = seen.figures(fed=0, dropped={}, seconds=0.0, now=5 * S)
    assert (figures.bursts, figures.held, figures.held_up) == (1, 999 * MS, [(2001 * MS, 3 * S)])
