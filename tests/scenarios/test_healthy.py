"""Two healthy rigs on a machine that others keep busy for a while: there is nothing to warn of but that."""

import sys

import pytest

from tests.faults.extent import chosen
from tests.ros.stage import Stage
from tests.scenarios.play import Played, Scenario, Theatre
from tests.scenarios.streams import Stream
from tests.scenarios.told import false_warnings, told

pytestmark = [pytest.mark.ros, pytest.mark.timeout(1800)]

RIGS = {
    "camera_and_lidar": Scenario(
        streams=[
            Stream("camera", 30, wobble_ms=2, late_ms=30, jitter_ms=8),
            Stream("lidar", 10, phase_ms=7, wobble_ms=3, late_ms=60, jitter_ms=10),
        ],
        options={"queue_size": 20, "slop": "30ms"},
    ),
    "imu_camera_and_gps": Scenario(
        streams=[
            Stream("imu", 200, wobble_ms=0.5),
            Stream("camera", 20, wobble_ms=2, late_ms=30, jitter_ms=8),
            Stream("gps", 1, phase_ms=40, wobble_ms=20, late_ms=80, jitter_ms=30),
        ],
        options={"queue_size": 100, "slop": "50ms"},
    ),
}
_QUIET_S, _BUSY_S = chosen(short=(10, 6), long=(25, 10))
_HOG = "while True: pass"


def play(stage: Stage) -> Played:
    theatre = Theatre(stage, RIGS)
    # Before that, nobody may have been heard of yet.
    theatre.watch.wait(lambda: all(theatre.watch.is_well(name) for name in RIGS), least_s=0)
    theatre.watch.begin("2")
    theatre.watch.wait(lambda: True, least_s=_QUIET_S)
    hogs = [stage.start("hog", [sys.executable, "-c", _HOG]) for _ in range(4)]
    theatre.watch.wait(lambda: True, least_s=_BUSY_S)
    for hog in hogs:
        hog.ask_to_end()
        assert hog.wait() != 0
    theatre.watch.wait(lambda: True, least_s=_QUIET_S)
    return theatre.watch.played()


@pytest.mark.parametrize("name", RIGS)
def test_nothing_is_said_of_a_healthy_rig_but_that_the_machine_is_busy(played: Played, name: str):
    assert not false_warnings(played, name, ()), told(played, name)
    assert set(played.shown[name]["2"]) <= {"healthy", "too_slow"}, told(played, name)
    assert "few_sets" not in played.shown[name]["1"]
    assert played.last[name]["rate_hz"] > 0.8 * played.last[name]["possible_hz"]
