"""`syncrelay export --stretch`: a long recording is worked on by several, and the rows are those of one pass."""

import json
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from syncrelay.cli.demo import shipped_config
from tests.bag.making import rig, write_mcap
from tests.cli.command import run
from tests.fleet.fleets import tree

PAIR = """
version: 1
groups:
  front:
    policy: approximate_time
    slop: 20ms
    {more}
    topics: [{{topic: /camera}}, {{topic: /lidar}}]
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_mcap(tmp_path / "long.mcap", rig(400), chunk_size=5_000)
    (tmp_path / "f.yaml").write_text(PAIR.format(more=""))
    return tmp_path


def rows(out: Path, group: str) -> pa.Table:
    """All rows of a group, its files one behind another."""
    return pa.concat_tables([pq.read_table(path) for path in sorted(out.glob(f"*/{group}*.parquet"))])


def ledger(out: Path) -> dict[str, object]:
    return json.loads((out / "ledger.jsonl").read_text().splitlines()[-1])


@pytest.mark.parametrize(
    "more",
    # Of every third set the place is known to the one before alone: stretches are done again, from where it ended.
    ["", "max_rate: 3 Hz", "every: 3", "max_wait: 30ms"],
)
def test_the_rows_and_the_counts_are_those_of_one_pass(more, folder):
    (folder / "f.yaml").write_text(PAIR.format(more=more))
    whole = run("export", "long.mcap", "--config", "f.yaml", "-o", "whole", folder=folder)
    words = ["export", "long.mcap", "--config", "f.yaml", "-o", "cut", "--stretch", "9s", "--jobs", "2"]
    done = run(*words, folder=folder)
    assert (whole.returncode, done.returncode, done.stdout) == (0, 0, "cut: 1 recording: 1 done\n"), done.stderr
    assert len(list(folder.glob("cut/*/front-*.parquet"))) == 5
    assert rows(folder / "cut", "front").equals(rows(folder / "whole", "front"))
    groups = [ledger(folder / out)["facts"]["groups"] for out in ("whole", "cut")]
    assert groups[0] == groups[1]
    assert run(*words, folder=folder).stdout == "cut: 1 recording: 1 done before\n"


def test_any_number_of_workers_gives_the_same_files(folder):
    words = ["export", "long.mcap", "--config", "f.yaml", "--stretch", "15s"]
    for jobs in ("1", "3"):
        assert run(*words, "-o", f"out{jobs}", "--jobs", jobs, folder=folder).returncode == 0
    assert tree(folder / "out1") == tree(folder / "out3")


def test_the_demos_rig_in_stretches_is_the_rig_as_one(tmp_path):
    (tmp_path / "demo.yaml").write_text(shipped_config())
    run("demo", "--record", "rig.mcap", "--seconds", "6", folder=tmp_path)
    for out, words in (("whole", ()), ("cut", ("--stretch", "2s"))):
        done = run("export", "rig.mcap", "--config", "demo.yaml", "-o", out, *words, folder=tmp_path)
        assert done.returncode == 0, done.stderr
    for group in ("camera_lidar", "lidar_imu"):
        assert rows(tmp_path / "cut", group).equals(rows(tmp_path / "whole", group))


def test_a_recording_of_one_stretch_has_one_file(folder):
    assert (
        run("export", "long.mcap", "--config", "f.yaml", "-o", "out", "--stretch", "10min", folder=folder).returncode
        == 0
    )
    assert [path.name for path in folder.glob("out/*/*")] == ["front-0001.parquet"]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--stretch", "5"), "--stretch 5"),
        (("--stretch", "10ms"), "expected 1s or more, as each stretch is a file; 10min is usual"),
        (("--stretch", "10min", "--format", "mcap"), "--stretch goes with --format parquet"),
        (("--stretch", "10min", "--format", "lerobot"), "--stretch goes with --format parquet"),
    ],
)
def test_lengths_that_make_no_sense_are_refused(words, told, folder):
    done = run("export", "long.mcap", "--config", "f.yaml", "-o", "out", *words, folder=folder)
    assert (done.returncode, told in done.stderr) == (2, True), done.stderr
