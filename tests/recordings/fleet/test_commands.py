"""`syncrelay fleet replay` and `syncrelay fleet analyze`."""

import json
import sys

import pytest

from tests.cli.command import run
from tests.cli.terminals import on_terminal
from tests.recordings.bag.making import rig, write_mcap
from tests.recordings.fleet.fleets import FILE, TOPICS, entries, file_text, make_fleet, replay_into, result, tree

pytestmark = pytest.mark.process


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A folder with three recordings, and what one undisturbed replay of them left in `out`."""
    folder = make_fleet(tmp_path_factory.mktemp("fleet"))
    ended = replay_into(folder)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "out: 3 recordings: 3 done\n", "")
    return folder


def test_the_sets_are_those_of_replay_alone(done, tmp_path):
    for name in ("r0", "r1", "r2"):
        output = tmp_path / f"{name}.mcap"
        run("replay", f"bags/{name}.mcap", "--config", FILE, "-o", str(output), folder=done)
        assert (result(done / "out", name) / "sets.mcap").read_bytes() == output.read_bytes()


def test_recordings_that_take_longer_than_they_may_have_failed(tmp_path):
    ended = replay_into(make_fleet(tmp_path, (20, 20)), "--time-limit", "1ms")
    assert (ended.returncode, ended.stdout) == (1, "out: 2 recordings: 2 failed\n")
    assert "r0.mcap: not done within 0.001 s: check it, or give it longer by --time-limit" in ended.stderr
    assert {entry["state"] for entry in entries(tmp_path / "out").values()} == {"failed"}


def test_the_ledger_tells_what_became_of_each_input(done):
    inputs = [{"topic": topic, "received": 30, "matched": 29, "dropped": {"shutdown": 1}} for topic in TOPICS]
    assert entries(done / "out")["r1"]["facts"]["groups"] == [{"name": "front", "sets": 29, "inputs": inputs}]


def test_the_analyses_are_those_of_analyze_alone(done):
    ended = run("fleet", "analyze", "bags", "--config", FILE, "--into", "analyses", "--jobs", "1", folder=done)
    assert (ended.returncode, ended.stderr.splitlines()[0]) == (0, "analyses: 3 recordings: 3 done")
    bag = done / "bags" / "r1.mcap"
    alone = run("analyze", str(bag), "--config", FILE, "--json", folder=done)
    assert (result(done / "analyses", "r1") / "analysis.json").read_text() == alone.stdout
    (row,) = (result(done / "analyses", "r1") / "facts.jsonl").read_text().splitlines()
    assert json.loads(row)["sets"] == 29


@pytest.mark.parametrize("words", [TOPICS, ()])
def test_analyses_need_no_file(words, done, tmp_path):
    ended = run("fleet", "analyze", "bags/*", *words, "--into", str(tmp_path / "out"), folder=done)
    assert (ended.returncode, "3 recordings: 3 done" in (ended.stderr if words else ended.stdout)) == (0, True)
    alone = run("analyze", str(done / "bags" / "r0.mcap"), *words, "--json", folder=done)
    assert (result(tmp_path / "out", "r0") / "analysis.json").read_text() == alone.stdout


def test_faults_are_laid_over_each_recording(done, tmp_path):
    ended = replay_into(done, "--what-if", "dead: /lidar from 1s", into=str(tmp_path / "out"))
    assert ended.returncode == 0
    assert {
        name: entry["facts"]["groups"][0]["sets"] for name, entry in entries(tmp_path / "out").items()
    } == dict.fromkeys(("r0", "r1", "r2"), 9)


def test_a_change_of_the_file_needs_leave_to_replace(tmp_path):
    make_fleet(tmp_path)
    replay_into(tmp_path)
    (tmp_path / FILE).write_text(file_text(slop="1ms"))
    before = tree(tmp_path / "out")
    refused = replay_into(tmp_path)
    assert (refused.returncode, tree(tmp_path / "out")) == (1, before)
    assert (
        "out: holds results of a file with other values: name another folder, or replace them with --overwrite"
        in refused.stderr
    )
    replaced = replay_into(tmp_path, "--overwrite")
    assert (replaced.returncode, replaced.stdout) == (0, "out: 3 recordings: 3 done\n")
    assert "only 0 of 20 possible sets are complete, because of slop 1 ms: without it, 19 would be" in replaced.stderr
    assert {entry["facts"]["groups"][0]["sets"] for entry in entries(tmp_path / "out").values()} == {0}
    assert replay_into(tmp_path, "--overwrite").stdout == "out: 3 recordings: 3 done before\n"


def test_a_variable_of_the_file_counts_as_its_text(done, tmp_path):
    (tmp_path / FILE).write_text(file_text(slop="${SLOP}"))
    words = ("fleet", "replay", str(done / "bags"), "--config", FILE, "--into", "out")
    run(*words, folder=tmp_path, environ={"SLOP": "5ms"})
    refused = run(*words, folder=tmp_path, environ={"SLOP": "1ms"})
    assert "holds results of a file with other values" in refused.stderr
    assert run(*words, folder=tmp_path, environ={"SLOP": "5ms"}).stdout == "out: 3 recordings: 3 done before\n"


def test_a_corrupt_recording_is_told_and_the_others_are_done(tmp_path):
    make_fleet(tmp_path)
    (tmp_path / "bags" / "r1.mcap").write_bytes(b"")
    (tmp_path / "bags" / "\udcff.mcap").write_text("no recording")
    ended = replay_into(tmp_path)
    assert (ended.returncode, ended.stdout) == (1, "out: 4 recordings: 2 done, 2 failed\n")
    assert "r1.mcap: is empty\n" in ended.stderr
    assert "\\udcff.mcap: is not a recording" in ended.stderr
    assert [name for name, entry in entries(tmp_path / "out").items() if entry["state"] == "failed"]
    again = replay_into(tmp_path)
    assert (again.returncode, again.stdout) == (1, "out: 4 recordings: 2 done before, 2 failed\n")


def test_strict_ends_at_the_first_fault(tmp_path):
    make_fleet(tmp_path, counts=(20, 30))
    # The largest is begun first.
    (tmp_path / "bags" / "bad.mcap").write_bytes(bytes(10**6))
    ended = replay_into(tmp_path, "--strict", "--jobs", "1")
    assert (ended.returncode, ended.stdout) == (1, "")
    told = "ended at the first recording that is at fault: 3 recordings: 1 failed, 2 not done"
    assert ended.stderr.endswith(f"syncrelay: {told}\n")


def test_a_recording_without_a_required_topic_is_told_each_time(tmp_path):
    make_fleet(tmp_path, counts=(20,))
    write_mcap(tmp_path / "bags" / "half.mcap", [frame for frame in rig(20) if frame.topic == "/camera"])
    for _ in range(2):
        ended = replay_into(tmp_path)
        assert ended.returncode == 1
        assert "half.mcap: front: /lidar is not in the recording" in ended.stderr


def test_on_a_terminal_progress_is_one_line_that_is_gone_at_the_end(done, tmp_path):
    words = ("fleet", "replay", str(done / "bags"), "--config", str(done / FILE), "--into", "out")
    with on_terminal([sys.executable, "-m", "syncrelay", *words], folder=tmp_path, environ={}) as terminal:
        assert terminal.wait_for_end() == 0
    shown = terminal.written.partition("out:")[0]
    assert "\r\x1b[K3 of 3 recordings" in shown
    assert "\n" not in shown
    assert shown.endswith("\r\x1b[K")
