"""Topics and types on DDS whose names no ROS node could have: the relay and those who look take no harm."""

import re
import subprocess
import sys

import pytest

from tests import preloaded
from tests.hostile_names import FORGED, assert_shown_safely
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import inputs
from tests.ros.sensors import assert_logged, front
from tests.ros.stage import Stage

pytestmark = pytest.mark.ros

_NAMES = (f"cam\x1b[31mera\n{FORGED}".encode(), b"1bad//", "kaméra".encode(), b"camer a", b"camer\xff\xfe")


def _publish(stage: Stage, *topics: bytes, namespace: bytes = b"geometry_msgs::msg", name: bytes) -> None:
    words = [word.hex() for word in (namespace, name, *topics)]
    odd = stage.start("odd", [sys.executable, "-m", "tests.ros.odd_publisher", *words], stdin=subprocess.PIPE)
    assert odd.answer() == "up"


def test_topics_that_ros_refuses_end_nothing_and_hide_nothing(stage: Stage):
    _publish(stage, *_NAMES, name=b"Vector3Stamped")
    stage.player({"/camera": VECTOR}).match(0)
    relay = stage.relay(front(inputs({"/camra": VECTOR, "/lidar": VECTOR})))
    assert_logged(relay, r"front: no set for .*/camra.*/lidar")
    assert_shown_safely(relay.stderr)


def test_a_type_of_an_odd_name_is_shown_as_text_and_no_package_is_imported_for_it(stage: Stage):
    # Importing this one opens a browser.
    _publish(stage, b"lidar", b"other", namespace=b"antigravity::msg", name=f"Ev\x1b[31mil\n{FORGED}".encode())
    relay = stage.relay(front())
    shown = re.escape(rf"antigravity/msg/Ev\x1b[31mil\n{FORGED}")
    assert_logged(relay, rf"front: no set for .*/odd_publisher.*{shown}.*{VECTOR}")
    look = [sys.executable, "-X", "importtime", "-m", "syncrelay", "init", "--from-graph", "--seconds", "3"]
    done = preloaded.run(look, environ=stage.environment, folder=stage.folder)
    assert (done.returncode, done.stdout) == (1, "")
    assert "antigravity\n" not in done.stderr
    assert_shown_safely(relay.stderr + done.stderr)
