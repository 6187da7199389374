"""`syncrelay export --format lerobot`: one dataset in the folder, and the episodes that it was made of."""

from pathlib import Path

import pyarrow.parquet as pq
import pytest

from tests.cli.command import run
from tests.recordings.datasets.drives import drive

FILE = """
version: 1
groups:
  robot:
    policy: exact_time
    topics: [{topic: /camera}, {topic: /joints}, {topic: /cmd}]
export:
  lerobot:
    fps: 10
    task: pick up the cube
    features:
      observation.images.front: /camera
      observation.state: /joints:position
      action: /cmd:twist.linear
"""
COMMAND = ("--config", "file.yaml", "--format", "lerobot", "-o", "out")


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "file.yaml").write_text(FILE)
    drive(tmp_path / "b.mcap")
    drive(tmp_path / "a.mcap", range(0, 900, 100))
    return tmp_path


def contents(out: Path) -> dict[str, bytes]:
    """The dataset's files, without what it was made of."""
    files = [path for path in out.rglob("*") if path.is_file() and ".episodes" not in path.parts]
    return {str(path.relative_to(out)): path.read_bytes() for path in files}


def lengths(out: Path) -> list[int]:
    return pq.read_table(out / "meta/episodes/chunk-000/file-000.parquet")["length"].to_pylist()


def test_recordings_are_episodes_in_their_order_and_only_what_is_missing_is_done(folder):
    run("export", "a.mcap", *COMMAND, folder=folder)
    done = run("export", "b.mcap", "a.mcap", *COMMAND, folder=folder)
    assert done.returncode == 0
    (told,) = done.stdout.splitlines()
    assert told.endswith("/out: 2 episodes with 29 frames; 0 frames repeated, 0 sets between frames left out")
    assert done.stderr.endswith("/out/.episodes: 2 recordings: 1 done, 1 done before\n")
    first = contents(folder / "out")
    assert (len(first), lengths(folder / "out")) == (6, [20, 9])
    again = run("export", "b.mcap", "a.mcap", *COMMAND, "--jobs", "1", folder=folder)
    assert again.stderr.endswith("2 recordings: 2 done before\n")
    assert contents(folder / "out") == first


def test_a_recording_that_cannot_be_an_episode_is_told_and_left_out(folder):
    drive(folder / "gap.mcap", [0, 100, 5000])
    done = run("export", "gap.mcap", "a.mcap", *COMMAND, folder=folder)
    assert done.returncode == 1
    assert "gap.mcap: no set for 4.9 s after 0.1 s, expected 0.5 s at most" in done.stderr
    assert lengths(folder / "out") == [9]
    alone = run("export", "gap.mcap", *COMMAND[:-1], "other", folder=folder)
    assert (alone.returncode, contents(folder / "other")) == (1, {})
    assert "no recording gave an episode, so there is no dataset" in alone.stderr


def test_a_task_that_is_said_once_goes_with_every_frame_or_the_key_that_costs_them_is_named(folder):
    # The first camera image was stamped before the task was received.
    said = {("/task", stamp): None for stamp in range(100, 2000, 100)}
    drive(folder / "task.mcap", instead=said, topics=("/camera", "/joints", "/cmd", "/task"))
    text = FILE.replace("exact_time", "latest_time\n    trigger: /camera\n    max_age: 250ms")
    text = text.replace("{topic: /cmd}", "{topic: /cmd}, {topic: /task, stamp: receive}")
    text = text.replace("task: pick up the cube", "task: {topic: /task, field: data}")
    (folder / "file.yaml").write_text(text)
    done = run("export", "task.mcap", *COMMAND, folder=folder)
    assert done.returncode == 1
    why = "because of max_age 250 ms for /task: without it, 19 would be"
    assert f"robot: only 2 of 20 possible sets are complete, {why}" in done.stderr
    assert lengths(folder / "out") == [2]
    (folder / "file.yaml").write_text(text.replace("stamp: receive", "stamp: receive, max_age: 60min"))
    done = run("export", "task.mcap", *COMMAND, "--overwrite", folder=folder)
    assert (done.returncode, lengths(folder / "out")) == (0, [19]), done.stderr


@pytest.mark.parametrize(
    ("words", "file", "code", "told"),
    [
        (("--images", "png"), FILE, 2, "`export:` in the file says what LeRobot gets"),
        ((), FILE[: FILE.index("export:")], 2, "write fps, task and features below `export:` `lerobot:`"),
        ((), FILE.replace("/joints:", "/joint:"), 1, "`/joint` is not an input of the group robot"),
        (("-o", "."), FILE, 1, "holds something else: name another folder, or an empty one"),
    ],
)
def test_what_cannot_be_meant_is_refused(folder, words, file, code, told):
    (folder / "file.yaml").write_text(file)
    done = run("export", "a.mcap", *COMMAND, *words, folder=folder)
    assert (done.returncode, done.stdout) == (code, "")
    assert told in done.stderr
    assert not (folder / "out").exists()
