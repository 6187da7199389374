import json
import shlex
import sys

import pytest

from syncrelay.cli.analyze import _analyze
from syncrelay.cli.demo import shipped_config
from tests.cli.command import run, run_here
from tests.recordings.bag.making import rig, write_mcap
from tests.ros.cdr_messages import STRING, VECTOR, serialize, vector
from tests.ros.configs import config, inputs
from tests.ros.frames import Frame
from tests.ros.streams import BEGIN, MS, at, merged
from tests.ros.summary import read_summary

_TOPICS = ("/camera", "/lidar")

_HINT = "hint: /lidar is stamped 3 ms before /camera: if one trigger starts both, write `offset: 3ms` at /lidar"


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
        "rig.mcap: 9.9 s, 200 messages of 2 topics",
        "/camera (geometry_msgs/msg/Vector3Stamped)",
        "  100 messages, 10 Hz, period 100 ms",
        "  received 5 ms after the stamp",
        "group front, approximate_time",
        "  0 of 100 possible sets",
        "  /lidar: 100 received, 0 in sets, 100 dropped (too_far 100)",
        "  /camera to the nearest /lidar: always -3 ms",
        "  sets by slop: 0 at 1 ms (in use), 100 at 3 ms (suggested), 100 at 3.3 ms, 100 at 4.5 ms, 100 at 6 ms",
        f"  {_HINT}",
        "  suggestion: 0 -> 100 of 100 possible sets with",
        "        slop: 3ms",
    ):
        assert line in done.stdout.splitlines()
    assert "`slop: 3ms`" in done.stdout


def test_the_json_holds_the_same_for_programs(folder):
    done = run_here("analyze", "rig.mcap", "--config", "f.yaml", "--json", folder=folder)
    found = json.loads(done.stdout)
    (group,) = found["groups"]
    assert (found["recording"], [topic["messages"] for topic in found["topics"]]) == ("rig.mcap", [100, 100])
    assert group["pairs"][0]["distance"]["median"] == 3_000_000
    assert group["by_slop"][:2] == [
        {"slop": 1_000_000, "sets": 0, "matched": 0.0, "median_span": 0},
        {"slop": 3_000_000, "sets": 100, "matched": 1.0, "median_span": 3_000_000},
    ]
    assert group["tried"] == {"messages": 200, "recorded": 200, "lasts": 9_903_000_000}
    assert [each["unneeded"] for each in group["inputs"]] == [0, 0]
    assert group["inputs"][0]["dropped"].keys() <= {"too_far", "superseded", "shutdown"}
    assert "over_slop" in {finding["code"] for finding in group["findings"]}
    assert {"slop", "min_period"} >= {change["key"] for change in group["suggestion"]["changes"]}


def test_the_written_file_gives_what_was_promised_and_leaves_nothing_to_change(folder, tmp_path):
    written = str(tmp_path / "better.yaml")
    done = run_here("analyze", "rig.mcap", "--config", "f.yaml", "--write", written, folder=folder)
    assert (done.returncode, done.stderr) == (0, f"syncrelay: wrote {written}\n")
    assert run_here("validate", written, folder=folder).returncode == 0
    replayed = run_here("replay", "rig.mcap", "--config", written, folder=folder)
    assert read_summary(replayed.stdout)["front"].sets == 100
    again = run_here("analyze", "rig.mcap", "--config", "f.yaml", "--write", written, folder=folder)
    assert (again.returncode, again.stderr) == (1, f"syncrelay: {written}: already exists and is not overwritten\n")
    new = tmp_path / "new.yaml"
    fits = run_here("analyze", "rig.mcap", "--config", written, "--write", str(new), folder=folder)
    assert (fits.returncode, fits.stderr) == (0, f"syncrelay: no values to change: {new} was not written\n")
    assert not new.exists()


def test_topics_without_a_file_get_one(folder, tmp_path):
    written = tmp_path / "new.yaml"
    done = run_here("analyze", "rig.mcap", *_TOPICS, "--write", str(written), folder=folder)
    assert done.returncode == 0
    text = done.stdout.partition("A file that gives these sets:\n\n")[2]
    assert text == written.read_text()
    replayed = run_here("replay", "rig.mcap", "--config", str(written), folder=folder)
    assert read_summary(replayed.stdout)["matched"].sets == 100


def test_what_was_received_before_its_stamp_is_said_to_have_been(tmp_path):
    # A message in four is 6 ms early, the others 5 ms.
    early = [each._replace(time=each.time - (10 + (place % 8 < 2)) * MS) for place, each in enumerate(rig(100))]
    write_mcap(tmp_path / "rig.mcap", early)
    said = "received 5 ms before the stamp"
    assert run_here("analyze", "rig.mcap", folder=tmp_path).stdout.count("  5 ms after receipt\n") == 2
    measured = run_here("analyze", "rig.mcap", *_TOPICS, folder=tmp_path).stdout
    assert measured.count(f"  {said} (90 % between 5 ms and 6 ms, at most 6 ms)\n") == 2
    assert run_here("init", "--from-bag", "rig.mcap", folder=tmp_path).stdout.count(f"  # 10 Hz, {said}\n") == 2


_INVENTORY = f"""\
other rig.mcap: 9.9 s, 300 messages of 4 topics
  topic    type                              messages  rate   stamps
  /camera  {VECTOR}  100       10 Hz  5 ms before receipt
  /lidar   {VECTOR}  100       10 Hz  5 ms before receipt
  /text    {STRING}               50        20 Hz  none: its type has no header, so no stamp to match by
  /unset   {VECTOR}  50        20 Hz  50 with stamp 0

Next, to match two topics or more:
  syncrelay analyze 'other rig.mcap' /camera /lidar
or to get a file for all of them, and see what it gives:
  syncrelay init --from-bag 'other rig.mcap' -o fusion.yaml
  syncrelay analyze 'other rig.mcap' --config fusion.yaml
"""


@pytest.fixture
def other_rig(folder):
    """A recording of the rig, and of topics that no group can take."""
    text = [Frame("/text", STRING, BEGIN + n * 50 * MS, serialize(STRING, "x")) for n in range(50)]
    unset = [Frame("/unset", VECTOR, BEGIN + n * 50 * MS, vector(0)) for n in range(50)]
    return write_mcap(folder / "other rig.mcap", merged(rig(100), text, unset))


def test_a_recording_alone_gets_its_topics_listed_and_what_to_type_next(folder, other_rig):
    done = run_here("analyze", other_rig.name, folder=folder)
    assert (done.returncode, done.stdout, done.stderr) == (0, _INVENTORY, "")
    commands = [shlex.split(line) for line in done.stdout.splitlines() if line.startswith("  syncrelay ")]
    for _, *words in commands:
        assert run(*words, folder=folder).returncode == 0


def test_the_list_is_there_for_programs_too(folder, other_rig):
    found = json.loads(run_here("analyze", other_rig.name, "--json", folder=folder).stdout)
    assert found["groups"] == []
    assert {topic["topic"]: (topic["messages"], topic["unfit"]) for topic in found["topics"]} == {
        "/camera": (100, None),
        "/lidar": (100, None),
        "/text": (50, "its type has no header, so no stamp to match by"),
        "/unset": (50, "50 messages, 50 with stamp 0"),
    }


def test_of_a_recording_with_nothing_to_match_no_command_is_shown(folder):
    write_mcap(folder / "one.mcap", at("/lidar", *range(0, 2000, 100)))
    done = run_here("analyze", "one.mcap", folder=folder)
    assert (done.returncode, done.stderr) == (0, "")
    assert "equal to receipt" in done.stdout
    assert done.stdout.splitlines()[-1].startswith("No two topics have stamps and enough messages")


def test_several_recordings_are_measured_one_after_another_and_a_faulty_one_ends_no_other(folder, monkeypatch):
    (folder / "empty.mcap").write_bytes(b"")
    write_mcap(folder / "short.mcap", rig(20))
    of = ("--config", "f.yaml", "--json")
    alone = [json.loads(run_here("analyze", bag, *of, folder=folder).stdout) for bag in ("rig.mcap", "short.mcap")]
    done = run_here("analyze", "rig.mcap", "empty.mcap", "short.mcap", *of, folder=folder)
    assert (done.returncode, done.stderr) == (1, "syncrelay: empty.mcap: is empty\n")
    assert list(map(json.loads, done.stdout.splitlines())) == alone
    monkeypatch.setitem(sys.modules, "adlfs", None)
    unread = run_here("analyze", "abfs://bucket/rig.mcap", "empty.mcap", "short.mcap", *of, folder=folder)
    assert (unread.returncode, json.loads(unread.stdout)) == (69, alone[1])
    (folder / "bad.yaml").write_text((folder / "f.yaml").read_text().replace("slop", "slopp"))
    faulty = run_here("analyze", "rig.mcap", "short.mcap", "--config", "bad.yaml", folder=folder)
    assert (faulty.returncode, faulty.stdout, faulty.stderr.count("unknown key")) == (1, "", 1)


def test_a_bug_on_one_of_several_recordings_ends_no_other(folder, monkeypatch):
    write_mcap(folder / "short.mcap", rig(20))
    of = ("--config", "f.yaml")
    alone = run_here("analyze", "short.mcap", *of, folder=folder).stdout

    def measured(bag, *words, **options):
        return _analyze(bag, *words, **options) if bag == "short.mcap" else 1 // 0

    monkeypatch.setattr("syncrelay.cli.analyze._analyze", measured)
    done = run_here("analyze", "rig.mcap", "short.mcap", *of, folder=folder)
    assert (done.returncode, done.stdout) == (70, alone)
    assert "ZeroDivisionError" in done.stderr
    assert done.stderr.endswith("syncrelay: it happened with the recording rig.mcap\n")
