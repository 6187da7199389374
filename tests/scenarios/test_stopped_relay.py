"""A relay that stands still for 3 s: only that is said, as long as data of that time is looked at."""

import re
import signal
import time

import pytest

from tests.ros.stage import Stage
from tests.scenarios.play import Played, Scenario, Theatre
from tests.scenarios.streams import Stream
from tests.scenarios.told import false_warnings, told

pytestmark = [pytest.mark.ros, pytest.mark.timeout(1800)]

_CAMERA, _LIDAR = Stream("camera", 10, wobble_ms=1), Stream("lidar", 10, phase_ms=7, wobble_ms=1)
RIGS = {
    "by_stamps": Scenario(streams=[_CAMERA, _LIDAR]),
    "by_receipt": Scenario(
        streams=[_CAMERA, _LIDAR],
        inputs={"camera": {"stamp": "receive"}, "lidar": {"stamp": "receive"}},
        options={"slop": "40ms"},
    ),
    "beside_an_imu": Scenario(streams=[_CAMERA, Stream("imu", 100)]),
    "best_effort": Scenario(
        streams=[
            Stream("camera", 10, wobble_ms=1, reliability="best_effort"),
            Stream("lidar", 10, phase_ms=7, reliability="best_effort"),
        ]
    ),
    "with_optional": Scenario(
        streams=[_CAMERA, _LIDAR, Stream("radar", 10, wobble_ms=1)],
        inputs={"radar": {"required": False}},
        options={"max_wait": "100ms"},
    ),
    "latest": Scenario(
        streams=[_CAMERA, _LIDAR],
        options={"policy": "latest_time", "trigger": "/latest/camera", "max_age": "300ms"},
    ),
}
_STOPPED_S = 3
# What is measured of the last messages goes back so far.
_AFTER_S = 35


def play(stage: Stage) -> Played:
    theatre = Theatre(stage, RIGS)
    theatre.watch.wait(lambda: all(theatre.watch.is_well(name) for name in RIGS))
    theatre.watch.begin("2")
    relay = theatre.file.relay
    relay.send(signal.SIGSTOP)
    time.sleep(_STOPPED_S)  # that is the fault
    relay.send(signal.SIGCONT)
    theatre.watch.wait(lambda: all(theatre.watch.is_well(name) for name in RIGS), least_s=_AFTER_S)
    return theatre.watch.played()


@pytest.mark.parametrize("name", RIGS)
def test_only_the_wait_for_the_relay_is_said(played: Played, name: str):
    assert not false_warnings(played, name, ()), told(played, name)
    assert set(played.shown[name]["2"]) <= {"too_slow", "healthy"}, told(played, name)


@pytest.mark.parametrize("name", ["by_stamps", "by_receipt", "beside_an_imu"])
def test_how_long_messages_waited_for_the_relay_is_said(played: Played, name: str):
    first = next((line for line in played.warnings_of(name) if line.act == "2"), None)
    assert first is not None, told(played, name)
    said = re.search(
        r"messages waited up to [\d.]+ s for the relay|the relay stood still for ([\d.]+) s", first.message
    )
    assert said, first.message
    # A busy machine may let it stand still for longer.
    assert said[1] is None or float(said[1]) >= _STOPPED_S - 0.1, first.message


@pytest.mark.parametrize("name", RIGS)
def test_it_is_well_again(played: Played, name: str):
    assert "healthy" in {finding["code"] for finding in played.last[name]["findings"]}, told(played, name)
