"""Topics on DDS whose names no ROS node could have: the relay and those who look leave them alone."""

import subprocess
import sys

import pytest

from tests.hostile_names import FORGED, assert_shown_safely
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import inputs
from tests.ros.sensors import assert_logged, front
from tests.ros.stage import Stage

pytestmark = pytest.mark.ros

_NAMES = {
    "text": [f"cam\x1b[31mera\n{FORGED}".encode(), b"1bad//", "kaméra".encode(), b"camer a"],
    "bytes": [b"camer\xff\xfe"],
}


@pytest.mark.parametrize("names", _NAMES.values(), ids=_NAMES)
def test_names_that_ros_refuses_end_nothing_and_hide_nothing(stage: Stage, names):
    argv = [sys.executable, "-m", "tests.ros.odd_publisher", *(name.hex() for name in names)]
    odd = stage.start("odd", argv, stdin=subprocess.PIPE)
    assert odd.answer() == "up"
    stage.player({"/camera": VECTOR, "/lidar": VECTOR}).match(0)
    relay = stage.relay(front(inputs({"/camra": VECTOR, "/lidar": VECTOR})))
    assert_logged(
        relay, r"nobody publishes /camra \(geometry_msgs/msg/Vector3Stamped\); did you mean `topic: /camera`\?"
    )
    look = [sys.executable, "-m", "syncrelay", "init", "--from-graph", "--seconds", "1"]
    done = subprocess.run(look, env=stage.environment, capture_output=True, text=True, timeout=120, check=False)
    assert (done.returncode, done.stdout) == (1, "")
    assert "there is nothing to match" in done.stderr
    assert relay.running()
    assert_shown_safely(done.stderr + relay.stderr)
