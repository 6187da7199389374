"""Every burst is found, and once."""

import random
from collections import deque

import pytest

from syncrelay.explain import Share, Standing, judge
from syncrelay.explain.epochs import reading
from syncrelay.explain.input_observation import InputObservation
from tests.explain.support.cases import LIDAR, camera
from tests.explain.support.groups import MS, NOW, S, a_group


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


def test_of_messages_that_come_at_once_a_pause_is_told():
    at_once = camera(figures={"received": [NOW - 4 * S] * 6 + [NOW - S] * 6, "pace_hz": 0.0})
    share = {"share": Share(50, 100, 10 * S, 0, absent=50)}
    (few,) = judge(a_group(at_once, LIDAR, figures=share, standing=Standing.FEW))
    assert "it paused for up to 3 s" in few.text


@pytest.mark.parametrize(("behind", "is_unit"), [(0, False), (50 * 365 * 86_400 * S, True)])
def test_what_a_latched_publisher_kept_and_sends_at_once_is_of_no_other_unit(behind, is_unit):
    stamps = [NOW - 33 * S + n * S // 3 - behind for n in range(100)]
    found = reading(stamps, [NOW + n * S // 3_000_000 - stamp for n, stamp in enumerate(stamps)])
    assert (found is not None and found.is_unit) is is_unit
