"""The demo's rig as a recording: the same each time, made without ROS, and with the shipped file it gives sets."""

from typing import Any

import pytest
from rosbags.highlevel import AnyReader

from syncrelay.cdr import read_stamp
from syncrelay.cli.demo import shipped_config
from syncrelay.rig.schedule import SENSORS
from tests.cli.command import run_here, run_python
from tests.ros.summary import read_summary

_WITHOUT_ROS = "import sys; sys.modules['rclpy'] = None; from syncrelay.cli import main; sys.exit(main(sys.argv[1:]))"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("demo")
    (made / "demo.yaml").write_text(shipped_config())
    done = run_python("-c", _WITHOUT_ROS, "demo", "--record", "rig.mcap", "--seconds", "3", folder=made)
    assert (done.returncode, done.stderr) == (0, "")
    return made


def test_it_holds_what_the_rig_sends(folder):
    with AnyReader([folder / "rig.mcap"]) as reader:
        counts = {each.topic: each.msgcount for each in reader.connections}
        first: dict[str, Any] = {
            each.topic: reader.deserialize(raw, each.msgtype) for each, _, raw in reader.messages()
        }
        received = [(time, read_stamp(raw)) for _, time, raw in reader.messages()]
    assert counts == {sensor.topic: pytest.approx(3 * sensor.rate_hz, rel=0.1) for sensor in SENSORS.values()}
    camera, lidar, imu = (first[sensor.topic] for sensor in SENSORS.values())
    assert (camera.width, camera.encoding, len(camera.data)) == (640, "rgb8", 640 * 480 * 3)
    assert lidar.width * lidar.height == 20_000
    assert imu.linear_acceleration.z == pytest.approx(9.81)
    times = [time for time, _ in received]
    assert times == sorted(times)
    assert all(stamp for _, stamp in received)


def test_the_shipped_file_gives_sets_of_it(folder):
    done = run_here("replay", "rig.mcap", "--config", "demo.yaml", folder=folder)
    assert done.returncode == 0
    assert all(group.sets > 25 for group in read_summary(done.stdout).values())


def test_a_seed_repeats_it(folder, tmp_path):
    run_here("demo", "--record", str(tmp_path / "same.mcap"), "--seconds", "3", folder=folder)
    run_here("demo", "--record", str(tmp_path / "other.mcap"), "--seconds", "3", "--seed", "1", folder=folder)
    content = (folder / "rig.mcap").read_bytes()
    assert (tmp_path / "same.mcap").read_bytes() == content
    assert (tmp_path / "other.mcap").read_bytes() != content
