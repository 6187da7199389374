"""Optional inputs that are slower than the sets: nothing is wrong with one whose messages are all in sets."""

import random
import re

import pytest

from tests.explain.scenario import Source, run

OPTIONS = {"slop": "40ms", "max_wait": "60ms"}
CAMERA, LIDAR = Source("/camera", hz=20), Source("/lidar", hz=10)


@pytest.mark.parametrize("hz", [0.3, 0.5, 1, 2, 5])
def test_one_that_is_punctual_is_never_told(hz):
    chance = random.Random(f"{hz}")
    for _ in range(4):
        gps = Source("/gps", hz=hz, phase_ms=chance.uniform(0, 30), jitter_ms=2, delay_jitter_ms=1, required=False)
        assert run(CAMERA, LIDAR, gps, seconds=40, options=OPTIONS).ever_found == set()


def test_one_that_comes_too_late_is_told_with_what_it_could_have_had():
    gps = Source("/gps", hz=2, delay_ms=200, required=False)
    told = run(CAMERA, LIDAR, gps, seconds=30, options=OPTIONS)
    assert told.codes == {"waiting_for_optional"}
    assert re.match(
        r"100 % of the sets leave without /gps after waiting 60 ms for it, 80 % because it comes at 2 Hz only: it"
        r" arrives 195 ms after the others, too late; ",
        told.first.text,
    )


def test_half_of_one_that_does_not_fit_is_told_beside_its_rate():
    # At 250 ms and 750 ms, between two sweeps of the lidar.
    told = run(CAMERA, LIDAR, Source("/gps", hz=4, required=False), seconds=30, options=OPTIONS)
    assert told.codes == {"waiting_for_optional"}
    assert "80 % of the sets leave without /gps after waiting 60 ms for it, 60 % because it comes at 4 Hz only" in (
        told.first.text
    )
