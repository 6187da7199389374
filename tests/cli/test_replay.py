import json
import shlex
import sys

import pytest

from tests.cli.command import run, run_here
from tests.cli.terminals import on_terminal
from tests.recordings.bag.making import rig, write_mcap, write_ros1
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs
from tests.ros.summary import read_summary

_SUMMARY = """\
front: 39 sets
front:   /camera: 40 received, 39 in sets, 1 dropped (shutdown 1)
front:   /lidar: 40 received, 39 in sets, 1 dropped (shutdown 1)
"""


def _file(**keys) -> str:
    topics = inputs({"/camera": VECTOR, "/lidar": VECTOR})
    return config({"front": {"policy": "approximate_time", "slop": "5ms", "topics": topics, **keys}})


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "f.yaml").write_text(_file())
    write_mcap(tmp_path / "rig.mcap", rig())
    return tmp_path


def test_it_prints_the_summary_of_the_relay(folder):
    done = run("replay", "rig.mcap", "--config", "f.yaml", folder=folder)
    assert (done.returncode, done.stdout, done.stderr) == (0, _SUMMARY, "")
    assert read_summary(done.stdout)["front"].sets == 39


def test_with_drops_there_is_a_line_a_drop_with_its_reason(folder):
    (folder / "f.yaml").write_text(_file(slop="1ms"))
    done = run_here("replay", "rig.mcap", "--config", "f.yaml", "--drops", folder=folder)
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(lines) == 80
    assert lines[0].keys() == {"group", "time", "topic", "stamp", "received", "reason"}
    assert {line["reason"] for line in lines} <= {"too_far", "superseded", "shutdown"}


def test_a_set_without_an_optional_input_says_what_is_missing(folder):
    topics = [*inputs({"/camera": VECTOR, "/lidar": VECTOR}), {"topic": "/imu", "type": VECTOR, "required": False}]
    (folder / "f.yaml").write_text(_file(topics=topics, max_wait="10ms"))
    done = run_here("replay", "rig.mcap", "--config", "f.yaml", "--json", folder=folder)
    line = json.loads(done.stdout.splitlines()[0])
    assert (line["missing"], line["stamps"]["/imu"], line["latency"]) == (["/imu"], None, 10_000_000)
    assert done.returncode == 0
    assert "/imu is not in the recording" in done.stderr


def test_where_no_set_leaves_it_names_what_tells_why(folder):
    (folder / "f.yaml").write_text(_file(slop="1ns"))
    done = run_here("replay", "rig.mcap", "--config", "f.yaml", folder=folder)
    assert (done.returncode, done.stdout.splitlines()[0]) == (0, "front: 0 sets")
    assert "no sets of front: `syncrelay analyze` with this recording and file tells why" in done.stderr


@pytest.mark.parametrize("output", ["out.mcap", "out"])
def test_what_is_written_can_be_replayed(output, folder):
    done = run_here("replay", "rig.mcap", "--config", "f.yaml", "-o", output, folder=folder)
    said = f"syncrelay: wrote {output}: 78 messages of 39 sets\n"
    assert (done.returncode, done.stdout, done.stderr) == (0, _SUMMARY, said)
    (folder / "g.yaml").write_text(_file().replace('"/', '"/front/'))
    again = run_here("replay", output, "--config", "g.yaml", folder=folder)
    assert read_summary(again.stdout)["front"].inputs["/front/camera"].received == 39


def test_that_ros1_is_written_as_ros2_is_said(folder):
    write_ros1(folder / "rig.bag", rig())
    done = run_here("replay", "rig.bag", "--config", "f.yaml", "-o", "out.mcap", folder=folder)
    assert (done.returncode, done.stdout) == (0, _SUMMARY)
    assert "this is a ROS 1 recording: its messages are written as ROS 2 CDR" in done.stderr


@pytest.fixture
def replayed(folder):
    """Replays the recording with more words: its first line, all that it printed, and what it said."""
    (folder / "f.yaml").write_text(_file(policy="approximate_time_eager", slop="20ms"))

    def replay(*words):
        done = run_here("replay", "rig.mcap", "--config", "f.yaml", *words, folder=folder)
        assert done.returncode == 0
        return done.stdout.partition("\n")[0], done.stdout, done.stderr.splitlines()

    return replay


def test_a_fault_changes_what_comes_and_is_named(replayed):
    assert replayed()[::2] == ("front: 40 sets", [])
    sets, told, said = replayed("--what-if", "dead: /lidar from 2s", "--what-if", "offset: /lidar 5ms")
    assert (sets, told.splitlines()[-1]) == ("front: 20 sets", "front:   /lidar: 20 received, 20 in sets, 0 dropped")
    assert said == [
        "syncrelay: faults laid over the recording (seed 0): `dead: /lidar from 2s`, `offset: /lidar 5ms`",
        "syncrelay: front: 20 sets with the faults, 40 without",
    ]


def test_a_terminal_gets_a_bar_on_stderr_that_leaves_no_trace_on_stdout(folder):
    line = f"exec {shlex.quote(sys.executable)} -m syncrelay replay rig.mcap --config f.yaml > out"
    with on_terminal(["sh", "-c", line], folder=folder, environ={}) as terminal:
        assert terminal.wait_for_end() == 0
    assert "reading" in terminal.written
    assert (folder / "out").read_text() == _SUMMARY
