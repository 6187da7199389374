import json

import pytest

from syncrelay.cli.demo import shipped_config
from tests.bag.making import rig, write_mcap
from tests.cli.command import run
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs
from tests.ros.summary import read_summary

_TOPICS = ("/camera", "/lidar")

_HINT = (
    "hint: /lidar is stamped 3 ms before /camera, give or take 0 s: if one trigger starts both, write `offset: 3ms` at"
    " /lidar"
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("analyze")
    group = {"policy": "approximate_time", "slop": "1ms", "topics": inputs(dict.fromkeys(_TOPICS, VECTOR))}
    (made / "f.yaml").write_text(config({"front": group}))
    (made / "demo.yaml").write_text(shipped_config())
    write_mcap(made / "rig.mcap", rig(100))
    return made


def test_it_prints_figures_curves_fates_findings_and_a_suggestion(folder):
    done = run("analyze", "rig.mcap", "--config", "f.yaml", folder=folder)
    assert (done.returncode, done.stderr) == (0, "")
    for line in (
        "rig.mcap: 9.9 s, 200 messages of the topics named",
        "/camera (geometry_msgs/msg/Vector3Stamped)",
        "  100 messages, 10 Hz, period 100 ms, 95 % within 0 s of it",
        "  received 5 ms after the stamp, 5 to 95 % 5 ms to 5 ms, at most 5 ms",
        "group front, approximate_time",
        "  by slop: 1 ms 0 %, 3 ms 100 %",
        "  front: 0 sets",
        f"  {_HINT}",
        "  suggestion, which gives 100 of 100 possible sets in place of 0:",
        "        slop: 3ms",
    ):
        assert line in done.stdout.splitlines()
    assert "over slop 1 ms; write `slop: 3ms`" in done.stdout


def test_the_json_holds_the_same_for_programs(folder):
    done = run("analyze", "rig.mcap", "--config", "f.yaml", "--json", folder=folder)
    found = json.loads(done.stdout)
    (group,) = found["groups"]
    assert (found["recording"], [topic["messages"] for topic in found["topics"]]) == ("rig.mcap", [100, 100])
    assert group["pairs"][0]["distance"]["median"] == 3_000_000
    assert group["by_slop"] == [
        {"slop": 1_000_000, "matched": 0.0, "median_span": 0},
        {"slop": 3_000_000, "matched": 1.0, "median_span": 3_000_000},
    ]
    assert group["inputs"][0]["dropped"].keys() <= {"too_far", "superseded", "shutdown"}
    assert "over_slop" in {finding["code"] for finding in group["findings"]}
    assert {"slop", "min_period"} >= {change["key"] for change in group["suggestion"]["changes"]}


def test_the_written_file_gives_what_was_promised(folder, tmp_path):
    written = str(tmp_path / "better.yaml")
    done = run("analyze", "rig.mcap", "--config", "f.yaml", "--write", written, folder=folder)
    assert (done.returncode, done.stderr) == (0, f"syncrelay: {written} is written\n")
    assert run("validate", written, folder=folder).returncode == 0
    replayed = run("replay", "rig.mcap", "--config", written, folder=folder)
    assert read_summary(replayed.stdout)["front"].sets == 100
    again = run("analyze", "rig.mcap", "--config", "f.yaml", "--write", written, folder=folder)
    assert (again.returncode, again.stderr) == (1, f"syncrelay: {written}: exists already, and is not overwritten\n")


def test_comments_of_the_file_stay(folder, tmp_path):
    run("demo", "--record", str(tmp_path / "demo.mcap"), "--seconds", "10", folder=folder)
    written = tmp_path / "better.yaml"
    run("analyze", str(tmp_path / "demo.mcap"), "--config", "demo.yaml", "--write", str(written), folder=folder)
    before = {line.partition("#")[2] for line in shipped_config().splitlines() if "#" in line}
    assert before <= {line.partition("#")[2] for line in written.read_text().splitlines()}
    assert run("validate", str(written), folder=folder).returncode == 0


def test_topics_without_a_file_get_one(folder, tmp_path):
    written = tmp_path / "new.yaml"
    done = run("analyze", "rig.mcap", *_TOPICS, "--write", str(written), folder=folder)
    assert done.returncode == 0
    text = done.stdout.partition("A file that gives these sets:\n\n")[2]
    assert text == written.read_text()
    replayed = run("replay", "rig.mcap", "--config", str(written), folder=folder)
    assert read_summary(replayed.stdout)["matched"].sets == 100


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["rig.mcap"], 2, "name a file with --config FILE, or the topics to match"),
        (["rig.mcap", "/camera", "--config", "f.yaml"], 2, "name a file with --config FILE, or the topics to match"),
        (["rig.mcap", "/camera"], 2, "name 2 topics or more"),
        (["rig.mcap", "/camera", "/lidr"], 1, "/lidr is not in the recording, did you mean `/lidar`?"),
        (["none.mcap", "/camera", "/lidar"], 1, "none.mcap: no such file or folder"),
    ],
)
def test_what_is_wrong_is_said(words, code, said, folder):
    done = run("analyze", *words, folder=folder)
    assert (done.returncode, done.stdout) == (code, "")
    assert done.stderr.startswith(f"syncrelay: {said}")
