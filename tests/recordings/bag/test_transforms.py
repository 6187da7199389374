"""Sets of a recording wait for the transforms that were recorded beside them, as they would have live."""

import re

import pytest
import yaml

from syncrelay.config import load
from syncrelay.explain import Code, Severity
from syncrelay.recordings.analysis.evaluation import evaluate
from syncrelay.recordings.analysis.few_sets import why_few_sets
from syncrelay.recordings.analysis.streams import read_streams
from syncrelay.recordings.analysis.watching import watch_group
from syncrelay.recordings.bag.replay import replay
from syncrelay.sync import Drop, DropReason, Match
from tests.cli.command import run_here
from tests.recordings.bag.making import CUSTOM_STORE, HEADERLESS, write_mcap, write_ros1, write_rosbag2
from tests.recordings.bag.reading import bound, one_by_one
from tests.ros.cdr_messages import VECTOR, vector
from tests.ros.configs import config, inputs
from tests.ros.frames import Frame
from tests.ros.streams import BEGIN, MS
from tests.ros.transforms import transforms

PERIOD = 100 * MS
FILE = config(
    {
        "front": {
            "policy": "exact_time",
            "transforms": {"target": "odom", "wait": "100ms"},
            "topics": inputs({"/a": VECTOR, "/b": VECTOR}),
        }
    }
)


def frames(*, count=40, late=30 * MS, frame="camera", moving="/tf"):
    """Pairs at 10 Hz, received at their stamps; /tf at 50 Hz, received `late` after its stamps."""
    found = [transforms("/tf_static", ("base_link", "camera", BEGIN), received=BEGIN - 2 * PERIOD)]
    for number in range(count):
        stamp = BEGIN + number * PERIOD
        found += [
            Frame("/a", VECTOR, stamp, vector(stamp, frame_id=frame)),
            Frame("/b", VECTOR, stamp, vector(stamp, frame_id="odom")),
        ]
    for number in range(-10, count * 5):
        stamp = BEGIN + number * 20 * MS + 7
        found.append(transforms(moving, ("odom", "base_link", stamp), received=stamp + late))
    return sorted(found, key=lambda each: each.time)


def replayed(path, text=FILE):
    left = []
    with bound(path, text=text) as (recording, bindings):
        listener = one_by_one(lambda _, outcome, now: left.append((outcome, now)))
        (result,) = replay(recording, bindings, listeners=[listener])
    return left, result


def evaluated(path):
    with bound(path, text=FILE) as (recording, bindings):
        (streams,) = read_streams(recording, bindings)
        group = bindings[0].group
        evaluation = evaluate(group, streams)
        return evaluation, watch_group(group, streams, evaluation)


@pytest.mark.parametrize("write", [write_mcap, write_rosbag2, write_ros1])
def test_a_set_leaves_when_the_transform_that_covers_it_was_received(write, tmp_path):
    left, result = replayed(write(tmp_path / "drive.bag", frames()))
    assert result.sets == 40
    # The first transform behind a stamp is 7 ns newer, and 30 ms under way.
    assert {now - outcome.stamps[0] for outcome, now in left if isinstance(outcome, Match)} == {30 * MS + 7}


@pytest.mark.parametrize(("late", "sets"), [(90 * MS, 40), (150 * MS, 0)])
def test_a_set_is_dropped_once_it_has_waited_too_long(late, sets, tmp_path):
    path = write_mcap(tmp_path / "drive.mcap", frames(late=late))
    left, result = replayed(path)
    assert result.sets == sets
    drops = [(each.reason, now - each.message.stamp) for each, now in left if isinstance(each, Drop)]
    assert drops == [(DropReason.NO_TRANSFORM, 100 * MS)] * 2 * (40 - sets)
    evaluation, _ = evaluated(path)
    assert [set_.left for set_ in evaluation.sets] == [now for each, now in left if isinstance(each, Match)]
    assert [each.dropped for each in evaluation.counts] == [each.counts.dropped for each in result.inputs]


@pytest.mark.parametrize("section", ["groups", "defaults"])
def test_analyze_writes_a_wait_that_is_enough(section, tmp_path):
    path = write_mcap(tmp_path / "drive.mcap", frames(late=150 * MS))
    file, written = tmp_path / "fusion.yaml", tmp_path / "better.yaml"
    text = FILE
    if section == "defaults":
        document = yaml.safe_load(FILE)
        document["defaults"] = {"transforms": document["groups"]["front"].pop("transforms")}
        text = yaml.safe_dump(document, sort_keys=False)
    file.write_text(text)
    done = run_here("analyze", str(path), "--config", str(file), "--write", str(written), folder=tmp_path)
    assert done.returncode in (0, 1), done.stderr
    (group,) = load(str(written)).groups
    assert group.options.transforms is not None
    assert group.options.transforms.target == "odom"
    assert 150 * MS < group.options.transforms.wait < 200 * MS
    left, _ = replayed(path, written.read_text())
    # Those that were matched last waited for what was not recorded.
    assert sum(isinstance(each, Match) for each, _ in left) > 35


def test_a_recording_without_transforms_gives_no_sets_and_messages_without_a_header_need_none(tmp_path):
    path = write_mcap(tmp_path / "none.mcap", [each for each in frames() if each.topic in ("/a", "/b")])
    _, result = replayed(path)
    assert result.sets == 0
    note = CUSTOM_STORE.types[HEADERLESS]("x")
    notes = [
        Frame(topic, HEADERLESS, BEGIN + number * PERIOD, bytes(CUSTOM_STORE.serialize_cdr(note, HEADERLESS)))
        for number in range(3)
        for topic in ("/a", "/b")
    ]
    group = {
        "policy": "approximate_time_eager",
        "slop": "10ms",
        "transforms": {"target": "odom"},
        "topics": inputs({"/a": HEADERLESS, "/b": HEADERLESS}, stamp="receive"),
    }
    _, result = replayed(write_mcap(tmp_path / "notes.mcap", notes, store=CUSTOM_STORE), config({"front": group}))
    assert result.sets == 3


def test_the_edge_that_lags_is_named_and_the_wait_that_is_suggested_has_all_sets_leave(tmp_path):
    path = write_mcap(tmp_path / "drive.mcap", frames(count=150, late=150 * MS))
    _, (found, *others) = evaluated(path)
    assert (found.finding.code, others) == (Code.NO_TRANSFORM, [])
    assert found.finding.text.startswith("odom -> base_link is 150 ms behind /a: ")
    wait = re.fullmatch(r"write `wait: (\w+)`", found.finding.suggestion or "")
    assert wait is not None
    _, result = replayed(path, FILE.replace("100ms", wait[1]))
    assert result.sets == 150


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"frame": "lens"}, "no transform names lens, the frame_id of /a: "),
        ({"frame": ""}, "messages of /a have an empty frame_id: "),
        ({"moving": "/elsewhere"}, "no transform names the target odom: "),
    ],
)
def test_what_is_missing_of_the_tree_is_named(keys, told, tmp_path):
    _, (found, *_) = evaluated(write_mcap(tmp_path / "drive.mcap", frames(count=150, **keys)))
    assert found.finding.code is Code.NO_TRANSFORM
    assert found.finding.severity is Severity.ERROR
    assert found.finding.text.startswith(told), found.finding.text


def test_of_few_sets_the_wait_for_transforms_is_named_as_the_reason(tmp_path):
    with bound(write_mcap(tmp_path / "drive.mcap", frames(late=150 * MS)), text=FILE) as (recording, (binding,)):
        (result,) = replay(recording, [binding])
        why = why_few_sets(recording, binding, [each.counts for each in result.inputs], result.sets)
    assert why == (
        "front: only 0 of 40 possible sets are complete, because of the wait for transforms to odom:"
        " without it, 40 would be"
    )
