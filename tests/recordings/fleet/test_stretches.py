"""`syncrelay export --stretch`: a long recording by several workers, and its rows are those without it."""

import os
import shutil
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from syncrelay.cli.demo import shipped_config
from tests.cli.command import run
from tests.recordings.fleet.fleets import entries, tree
from tests.recordings.fleet.test_ending import ENVIRON, children, wait_until
from tests.ros import recordings
from tests.ros.configs import config, inputs

CUT = ("--stretch", "3s", "--jobs", "2")
# It is of rows: without their megabytes of pixels and points.
LEAN = ("--fields", "/demo/camera/image_raw:header", "--fields", "/demo/lidar/points:header,width")


def export(folder, into, *words, bag="rig.mcap", file="demo.yaml"):
    return run("export", bag, "--config", file, "-o", into, *words, folder=folder)


def rows(out: Path, group: str, pattern: str = "-*") -> pa.Table:
    """All rows of a group, file behind file."""
    paths = sorted(out.glob(f"*/{group}{pattern}.parquet"))
    return pa.concat_tables([pq.read_table(path) for path in paths])


def files(out: Path) -> list[str]:
    return sorted(path.name for path in out.glob("*/*"))


@pytest.fixture(scope="module")
def rigged(tmp_path_factory):
    """The demo's recording and file; exported as a whole, and in stretches by two workers."""
    folder = tmp_path_factory.mktemp("stretches")
    (folder / "demo.yaml").write_text(shipped_config())
    run("demo", "--record", "rig.mcap", "--seconds", "8", folder=folder)
    assert export(folder, "whole", *LEAN).returncode == 0
    done = export(folder, "cut", *LEAN, *CUT)
    assert (done.returncode, done.stdout) == (0, "cut: 1 recording: 1 done\n")
    return folder


@pytest.mark.parametrize("group", ["camera_lidar", "lidar_imu"])
def test_the_rows_of_all_stretches_are_those_of_one_pass(rigged, group):
    assert [name for name in files(rigged / "cut") if group in name] == [f"{group}-000{n}.parquet" for n in (1, 2, 3)]
    whole = rows(rigged / "whole", group, "")
    assert rows(rigged / "cut", group).equals(whole)
    assert len(whole) > 60


def test_the_ledger_tells_of_the_recording_what_it_tells_of_one_pass(rigged):
    whole, cut = entries(rigged / "whole")["rig"], entries(rigged / "cut")["rig"]
    assert (cut["facts"], cut["content"]) == (whole["facts"], whole["content"])
    assert sorted(cut["files"]) == files(rigged / "cut")
    assert export(rigged, "cut", *LEAN, *CUT).stdout == "cut: 1 recording: 1 done before\n"


def test_the_length_is_an_option_that_decides_what_is_there(rigged):
    refused = export(rigged, "cut", *LEAN, "--stretch", "4s")
    assert refused.returncode != 0
    assert "holds results of other options" in refused.stderr


def test_a_recording_shorter_than_a_stretch_is_one(rigged, tmp_path):
    words = (*LEAN[2:], "--stretch", "10min", "--group", "lidar_imu")
    assert export(rigged, str(tmp_path / "out"), *words).returncode == 0
    assert files(tmp_path / "out") == ["lidar_imu-0001.parquet"]
    assert rows(tmp_path / "out", "lidar_imu").equals(rows(rigged / "whole", "lidar_imu", ""))


@pytest.mark.parametrize("thinned", [{"every": 2}, {"max_rate": "2 Hz"}], ids=str)
def test_a_stretch_that_does_not_begin_as_the_one_before_ends_is_written_all_the_same(thinned, rigged, tmp_path):
    topics = inputs({"/demo/imu/data": "sensor_msgs/msg/Imu", "/demo/lidar/points": "sensor_msgs/msg/PointCloud2"})
    group = {"policy": "approximate_time", "slop": "8ms", "queue_size": 50, "topics": topics, **thinned}
    (tmp_path / "thin.yaml").write_text(config({"thin": group}))
    bag = str(rigged / "rig.mcap")
    for into, words in {"whole": (), "cut": ("--stretch", "1s", "--jobs", "3")}.items():
        fields = ("--fields", "/demo/lidar/points:width", *words)
        assert export(tmp_path, into, *fields, bag=bag, file="thin.yaml").returncode == 0
    assert len(files(tmp_path / "cut")) == 8
    assert rows(tmp_path / "cut", "thin").equals(rows(tmp_path / "whole", "thin", ""))


def test_a_damaged_recording_is_done_as_a_whole(rigged, tmp_path):
    content = (rigged / "rig.mcap").read_bytes()
    (tmp_path / "rig.mcap").write_bytes(content[: len(content) * 3 // 4])
    shutil.copy(rigged / "demo.yaml", tmp_path)
    whole, cut = export(tmp_path, "whole", *LEAN), export(tmp_path, "cut", *LEAN, *CUT)
    assert cut.returncode == whole.returncode
    assert files(tmp_path / "cut") == ["camera_lidar-0001.parquet", "lidar_imu-0001.parquet"]
    assert rows(tmp_path / "cut", "camera_lidar").equals(rows(tmp_path / "whole", "camera_lidar", ""))
    assert entries(tmp_path / "cut")["rig"]["facts"] == entries(tmp_path / "whole")["rig"]["facts"]


def test_workers_and_commands_that_are_killed_leave_nothing_half_written(rigged, tmp_path):
    words = [sys.executable, "-m", "syncrelay", "export", str(rigged / "rig.mcap"), "--config", "demo.yaml"]
    words += ["-o", str(tmp_path / "out"), *CUT]

    def is_at_work_or_done():
        # On a machine that stood still it may have done all of it meanwhile.
        return list(tmp_path.glob("out/.partial/*.write-1.*/*.parquet")) or command.poll() is not None

    with subprocess.Popen(words, cwd=rigged, env=ENVIRON, stdout=-1, stderr=-1) as command:
        wait_until(is_at_work_or_done)
        command.kill()
    with subprocess.Popen(words, cwd=rigged, env=ENVIRON, stdout=-1, stderr=-1) as command:
        wait_until(is_at_work_or_done)
        for worker in children(command.pid):
            with suppress(ProcessLookupError):
                os.kill(worker, signal.SIGKILL)
        command.communicate(timeout=60)
    assert command.returncode == 0
    assert export(rigged, str(tmp_path / "undisturbed"), *CUT).returncode == 0
    assert tree(tmp_path / "out") == tree(tmp_path / "undisturbed")


def test_what_is_no_length_of_a_stretch_is_refused(rigged):
    no_unit, too_short = (export(rigged, "other", "--stretch", text) for text in ("3", "3ms"))
    assert "--stretch 3: `3` has no unit, expected one such as `3ms`" in no_unit.stderr
    assert "--stretch 3ms: expected 1s or more, as each stretch is a file" in too_short.stderr
    of_mcap = export(rigged, "other", "--stretch", "3s", "--format", "mcap")
    assert "--stretch goes with --format parquet" in of_mcap.stderr
    assert not (rigged / "other").exists()


@pytest.mark.real_data
@pytest.mark.parametrize(
    ("bag", "topics", "times"),
    [
        (recordings.HUSKY, ("/fix", "/husky_velocity_controller/odom", "/imu/data"), ("60ms", "2min")),
        (recordings.VEHICLE, ("/imu_data", "/magnetic_vector", "/scan"), ("30ms", "6s")),
    ],
)
def test_real_recordings_give_the_same_rows(bag, topics, times, real_data, tmp_path):
    slop, length = times
    group = {"policy": "approximate_time", "slop": slop, "topics": [{"topic": topic} for topic in topics]}
    (tmp_path / "near.yaml").write_text(config({"near": group}))
    for into, words in {"whole": (), "cut": ("--stretch", length, "--jobs", "2")}.items():
        fields = [word for topic in topics for word in ("--fields", f"{topic}:header.stamp")]
        assert export(tmp_path, into, *fields, *words, bag=str(real_data / bag), file="near.yaml").returncode == 0
    assert len(files(tmp_path / "cut")) > 1
    assert rows(tmp_path / "cut", "near").equals(rows(tmp_path / "whole", "near", ""))
