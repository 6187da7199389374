"""Every burst is found, and once."""

import random
from collections import deque

import pytest

from syncrelay.explain.input_observation import InputObservation
from tests.explain.support.groups import MS, S


def _stream(first, last, *, period=10 * MS):
    return [(stamp, stamp + MS) for stamp in range(first, last, period)]


def _held(first, last, *, period=10 * MS):
    """Messages of a stretch of time that all come at its end."""
    return [(stamp, last + n * MS // 10) for n, stamp in enumerate(range(first, last, period))]


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
