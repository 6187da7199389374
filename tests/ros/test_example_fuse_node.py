"""The example of a node with the engine inside, over DDS."""

import itertools
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.ros.cdr_messages import STORE, VECTOR, header, serialize, stamp_of
from tests.ros.frames import Frame
from tests.ros.relaying import play_until_out
from tests.ros.stage import Stage
from tests.ros.streams import BEGIN, MS

pytestmark = pytest.mark.ros

_NODE = Path(__file__).parents[2] / "examples/fuse_node.py"
_IMU, _MAG = "sensor_msgs/msg/Imu", "sensor_msgs/msg/MagneticField"
_NONE = np.zeros(9)


def _xyz(x: float, y: float, z: float):
    return STORE.types["geometry_msgs/msg/Vector3"](x, y, z)


def _pair(number: int) -> list[Frame]:
    stamp = BEGIN + number * 100 * MS
    upright = STORE.types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    imu = (header(stamp), upright, _NONE, _xyz(0.0, 0.0, 0.25), _NONE, _xyz(0.0, 0.0, 9.8), _NONE)
    mag = (header(stamp + 5 * MS), _xyz(0.0, -1.0, 0.0), _NONE)
    return [
        Frame("/imu", _IMU, stamp, serialize(_IMU, *imu)),
        Frame("/mag", _MAG, stamp + 5 * MS, serialize(_MAG, *mag)),
    ]


def test_a_node_of_ones_own_matches_what_it_receives(stage: Stage):
    stage.start("heading", [sys.executable, str(_NODE)])
    collector = stage.collector({"/heading": VECTOR})
    play_until_out(
        stage.player({"/imu": _IMU, "/mag": _MAG}), collector, (_pair(n) for n in itertools.count()), ["/heading"]
    )
    payload = collector.payloads("/heading")[0]
    told: Any = STORE.deserialize_cdr(payload, VECTOR)
    assert (stamp_of(payload) - BEGIN) % (100 * MS) == 0
    assert (told.vector.x, told.vector.y) == (math.pi / 2, 0.25)
