"""A clock as trigger on a recording: sets at a fixed rate, in all that commands say and write."""

import json

import pytest
from rosbags.highlevel import AnyReader

from syncrelay.cdr import read_stamp
from syncrelay.rig.schedule import SENSORS
from tests.cli.command import run_here
from tests.ros.configs import config

_TOPICS = [sensor.topic for sensor in SENSORS.values()]
_WAIT = 60_000_000
_TEXT = config(
    {
        "fixed": {
            "policy": "latest_time",
            "trigger": "29.97 Hz",
            "max_age": "200ms",
            "max_wait": "60ms",
            "restamp": "trigger",
            "topics": [{"topic": topic} for topic in _TOPICS],
        }
    }
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("clock")
    (made / "f.yaml").write_text(_TEXT)
    assert run_here("demo", "--record", "rig.mcap", "--seconds", "4", folder=made).returncode == 0
    return made


@pytest.fixture(scope="module")
def lines(folder):
    done = run_here("replay", "rig.mcap", "--config", "f.yaml", "--json", "-o", "out.mcap", folder=folder)
    assert done.returncode == 0
    return [json.loads(line) for line in done.stdout.splitlines()]


def test_what_is_written_has_the_stamps_of_the_ticks(folder, lines):
    with AnyReader([folder / "out.mcap"]) as reader:
        written = [read_stamp(raw) for connection, _, raw in reader.messages() if "lidar" in connection.topic]
    assert written == [line["time"] - _WAIT for line in lines]
    assert len(written) > 100


def test_the_drawing_of_a_file_tells_the_clock(folder):
    assert "trigger 29.97 Hz" in run_here("graph", "f.yaml", folder=folder).stdout


def test_another_rate_is_told_by_diff(folder):
    (folder / "g.yaml").write_text(_TEXT.replace("29.97 Hz", "10 Hz"))
    assert "trigger: 29.97 Hz -> 10 Hz" in run_here("diff", "f.yaml", "g.yaml", folder=folder).stdout


def test_a_drawn_case_tells_the_stamp_of_the_tick(folder):
    case = """
version: 1
config: drawn.yaml
cases:
  by the clock:
    drawing: |
      a |.a.......
      b |..b......
      -> @5: ab stamped tick
"""
    (folder / "tests.yaml").write_text(case)
    drawn = {"policy": "latest_time", "trigger": "20 Hz", "restamp": "trigger"}
    topics = [{"topic": f"/{name}", "type": "sensor_msgs/msg/Imu"} for name in "ab"]
    (folder / "drawn.yaml").write_text(config({"drawn": {**drawn, "topics": topics}}))
    done = run_here("test", "tests.yaml", folder=folder)
    assert done.returncode == 0, done.stdout + done.stderr
