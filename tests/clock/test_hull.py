"""The likeliest line under points, held to what trying all of them gives."""

import random
from itertools import combinations
from math import log

import pytest

from syncrelay.clock.hull import Hull


def drawn(seed, n=19):
    """So few points that none of them is left out as one whose stamp was late."""
    chance = random.Random(seed)
    rate, level = chance.uniform(-1e-3, 1e-3), chance.uniform(-1, 1)
    times = sorted(chance.uniform(0, 60) for _ in range(n))
    return [(x, level + rate * x + chance.expovariate(500), chance.randint(1, 5)) for x in times]


def mean_height(points, rate):
    level = min(y - rate * x for x, y, _ in points)
    return sum(n * (y - rate * x - level) for x, y, n in points) / sum(n for *_, n in points)


@pytest.mark.parametrize("seed", range(20))
def test_the_line_is_that_with_points_nearest_above_it(seed):
    points = drawn(seed)
    slopes = [(y2 - y1) / (x2 - x1) for (x1, y1, _), (x2, y2, _) in combinations(points, 2)]
    likeliest = min(slopes, key=lambda slope: mean_height(points, slope))
    hull = Hull(points, 0.0)
    assert hull.slope(hull.mean, 0.0) == pytest.approx(likeliest)
    assert hull.height(likeliest) == pytest.approx(mean_height(points, likeliest))


@pytest.mark.parametrize("evidence", [1.0, 3.0, 16.0])
@pytest.mark.parametrize("seed", range(5))
def test_beyond_its_bounds_a_slope_is_less_likely(seed, evidence):
    points = drawn(seed)
    hull = Hull(points, 0.0)
    slope = hull.slope(hull.mean, 0.0)
    free = sum(n for *_, n in points) - 2
    for bound in hull.bounds(slope, evidence, 0.0):
        assert free * log(mean_height(points, bound) / mean_height(points, slope)) == pytest.approx(evidence)


def test_of_two_points_follows_no_slope():
    hull = Hull([(0.0, 0.0, 1), (1.0, 1e-3, 1)], 0.0)
    assert hull.bounds(1e-3, 3.0, 0.0) == (float("-inf"), float("inf"))
