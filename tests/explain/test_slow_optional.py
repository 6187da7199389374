"""Optional inputs that are slower than the sets: nothing is wrong with one whose messages are all in sets."""

import pytest

from tests.explain.scenario import Source, run

OPTIONS = {"slop": "40ms", "max_wait": "60ms"}
CAMERA, LIDAR = Source("/camera", hz=20), Source("/lidar", hz=10)


# At 4 Hz, half of the messages come between two sweeps of the lidar.
@pytest.mark.parametrize(("hz", "delay_ms"), [(2, 200), (4, 5)])
def test_one_that_comes_too_late_or_between_the_sets_is_told(hz, delay_ms):
    gps = Source("/gps", hz=hz, delay_ms=delay_ms, required=False)
    told = run(CAMERA, LIDAR, gps, seconds=30, options=OPTIONS)
    assert told.says_only("waiting_for_optional", "/gps"), told.warnings
