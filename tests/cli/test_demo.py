"""The demo as a user starts it: real processes over DDS."""

import os
import re
import signal
import sys
from pathlib import Path

import pytest

from syncrelay.cli.demo import isolation
from tests.cli.terminals import on_terminal
from tests.ros.processes import DEADLINE_S, children_of, is_alive

_DEMO = [sys.executable, "-m", "syncrelay", "demo"]


@pytest.mark.parametrize(
    ("environ", "added"),
    [
        ({}, {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "FASTDDS_BUILTIN_TRANSPORTS": "DEFAULT"}),
        ({"ROS_DOMAIN_ID": "7"}, {}),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}, {}),
    ],
)
def test_it_stays_on_this_machine_unless_a_network_was_chosen(environ, added):
    assert isolation(environ) == added


def summed_up(text):
    """Group name -> (sets, p50 and p95 of the spans in milliseconds, counts of each input) of a summary."""
    return {each.split(":")[0]: _of_group(" ".join(each.split())) for each in text.replace("\r", "").split("\n\n")[1:]}


def _of_group(text):
    (sets,) = map(int, re.findall(r"(\d+) sets?, last", text)[:1])
    span = [
        float(number) / {"us": 1000, "ms": 1, "s": 0.001}[unit]
        for number, unit in re.findall(r"p\d\d ([\d.]+) (\w+)", text)
    ]
    inputs = re.findall(r"(\d+) received, (\d+) in sets, (\d+) waiting,(?: (\d+) not needed,)? (\d+) dropped", text)
    return sets, *span[:2], [tuple(int(count or 0) for count in counts) for counts in inputs]


@pytest.mark.ros
def test_it_matches_a_simulated_rig_until_a_signal_ends_it_sums_up_and_leaves_nothing(stage):
    demo = stage.start("demo", [*_DEMO, "--seed", "7"])
    demo.wait_until(
        lambda: re.search(r"camera_lidar: .* span .* lidar_imu: .* span", demo.stdout), "sets of both groups"
    )
    sensors = children_of(demo.pid)
    assert len(sensors) == 3
    assert all(b"--seed=7" in Path(f"/proc/{pid}/cmdline").read_bytes() for pid in sensors)
    stage.note_shared_memory()
    demo.send(signal.SIGTERM)
    assert demo.wait() == 0, demo.stderr
    assert not any(map(is_alive, sensors))
    assert stage.left_in_shared_memory() == set()
    groups = summed_up(demo.stdout)
    assert set(groups) == {"camera_lidar", "lidar_imu"}
    for sets, _, p95, inputs in groups.values():
        assert p95 <= 10
        for received, matched, waiting, unneeded, dropped in inputs:
            assert 0 < sets == matched
            assert waiting == 0
            assert received == matched + unneeded + dropped
    assert groups["camera_lidar"][1] < 3  # the offset is in use: without it, 12
    assert re.search(r"offset: -12 ms on /demo/camera/image_raw: span .* 1[12](\.\d+)? ms without it", demo.stdout)
    # A line a second, and no more.
    seconds = [float(each) for each in re.findall(r"^ +(\d+\.\d) s  camera_lidar", demo.stdout, re.MULTILINE)]
    assert 0 < len(seconds) <= seconds[-1] + 1
    assert "\x1b" not in demo.stdout
    # Of what a busy machine makes of a rig, the relay may warn.
    assert [line for line in demo.said if not line.startswith("[WARN]")] == []


@pytest.mark.ros
def test_it_can_be_stopped_before_the_sensors_publish(stage):
    stage.before_each_sensor("import time; time.sleep(600)")
    demo = stage.start("demo", _DEMO)
    demo.wait_until(lambda: len(children_of(demo.pid)) == 3, "the rig's processes")
    sensors = children_of(demo.pid)
    demo.send(signal.SIGINT)
    assert demo.wait() == 0
    assert demo.stdout == "Starting a simulated camera, lidar and IMU ...\n"
    # Of sensors that take their time to end, it may warn.
    assert [line for line in demo.said if not line.startswith("[WARN]")] == ["syncrelay: stopped before it started"]
    assert not any(map(is_alive, sensors))


# No sensor sends anything, and one of them hangs in DDS at its end.
_ILL = """\
import itertools, sys, time
from rclpy.node import Node
from syncrelay.rig import schedule
schedule.schedule = lambda *_, **__: itertools.repeat(schedule.Shot(0, 0, 1 << 62))
if 'imu' in sys.orig_argv: Node.destroy_node = lambda self: time.sleep(600)
"""


@pytest.mark.ros
def test_it_fails_if_no_set_came_and_removes_what_a_sensor_left_that_was_killed(stage):
    stage.before_each_sensor(_ILL)
    demo = stage.start("demo", [*_DEMO, "--seconds", "2"])
    demo.wait_until(lambda: "lidar_imu" in demo.stdout, "a first line")
    _, _, imu = children_of(demo.pid)
    stage.note_shared_memory()
    demo.wait_for_log("imu to end;")
    os.kill(imu, signal.SIGKILL)
    assert demo.wait() == 1
    assert re.search(r"^camera_lidar: .*no set yet", demo.stdout, re.MULTILINE)
    assert "the rig's imu ended with exit code -9" in demo.stderr
    assert stage.left_in_shared_memory() == set()


@pytest.mark.ros
def test_a_terminal_sees_the_strip_from_when_all_sensors_publish_and_keeps_the_summary(stage):
    # Longer than the demo runs, and than a relay waits for messages before it asks for them.
    stage.before_each_sensor("import os, time; time.sleep(float(os.environ['TWICE_AS_LONG_S']))")
    # Longer where a busy machine left a group no set.
    for seconds in (3, 6, 15, 45):
        argv = [*_DEMO, "--seconds", f"{seconds}"]
        environ = {**stage.environment, "TWICE_AS_LONG_S": f"{2 * seconds}"}
        with on_terminal(argv, folder=stage.folder, environ=environ) as terminal:
            code = terminal.wait_for_end(2 * seconds + DEADLINE_S)
        if code == 0:
            break
    assert code == 0, terminal.written
    drawn, _, after = terminal.written.partition("\x1b[?1049l")
    assert "Starting a simulated camera" in drawn.partition("\x1b[?1049h")[2]
    assert re.search(r"camera -12 ms.*A", drawn)
    assert "each letter is a set" in drawn
    assert "38;5" not in terminal.written  # the stage sets NO_COLOR
    assert set(summed_up(after)) == {"camera_lidar", "lidar_imu"}
    assert "nobody publishes" not in terminal.written
