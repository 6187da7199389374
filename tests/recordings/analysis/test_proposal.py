"""A file proposed for a recording is in order, and gives sets of it."""

from contextlib import closing
from pathlib import Path

import pytest

from syncrelay.config import load_text
from syncrelay.errors import NothingToMatchError
from syncrelay.recordings.analysis import propose
from syncrelay.recordings.analysis.inventory import no_header
from syncrelay.recordings.bag import open_recording
from syncrelay.recordings.bag.recording import Definition
from syncrelay.recordings.bag.replay import replay
from tests.recordings.bag.making import BEST_EFFORT, write_mcap, write_rosbag2
from tests.recordings.bag.reading import bound
from tests.ros.cdr_messages import STORE, STRING, VECTOR, header, serialize, vector
from tests.ros.frames import Frame
from tests.ros.streams import BEGIN, MS, at, jittery, merged

DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
POINT = "geometry_msgs/msg/PointStamped"


def _left_out(bag: Path) -> dict[str, str]:
    """Why each topic is left out, by its name and type."""
    with closing(open_recording([str(bag)])) as recording:
        return dict(sentence.split(": ", 1) for sentence in propose(recording).left_out)


def _proposed(bag: Path) -> tuple[str, dict[str, int]]:
    """The text for a recording, and the sets of each group when it is replayed."""
    with closing(open_recording([str(bag)])) as recording:
        text = propose(recording).text
    with bound(bag, text=text) as (recording, bindings):
        results = replay(recording, bindings)
    return text, {result.name: result.sets for result in results}


def _stereo_and_lidar() -> list[Frame]:
    camera = jittery("/left", period_ms=50, jitter_ms=2, count=100, seed=1)
    other = [frame._replace(topic="/right") for frame in camera]
    return merged(camera, other, jittery("/lidar", period_ms=100, jitter_ms=3, count=50, seed=2))


def test_topics_of_one_epoch_become_a_group_and_one_of_each_another(tmp_path):
    bag = write_mcap(tmp_path / "rig.mcap", _stereo_and_lidar())
    text, sets = _proposed(bag)
    groups = {group.name: group for group in load_text(text).groups}
    assert {name: {topic.topic for topic in group.topics} for name, group in groups.items()} == {
        "epoch_1": {"/left", "/right"},
        "fused": {"/lidar", "/left"},
    }
    assert groups["epoch_1"].options.policy == "exact_time"
    assert sets["epoch_1"] == 100
    assert sets["fused"] >= 49
    assert _left_out(bag) == {}


def test_what_was_measured_stands_in_comments(tmp_path):
    bag = write_rosbag2(tmp_path / "rig", _stereo_and_lidar(), qos=[BEST_EFFORT])
    lines = _proposed(bag)[0].splitlines()
    assert "  epoch_1:  # 100 of 100 possible sets of the recording" in lines
    (lidar,) = (line for line in lines if "/lidar" in line)
    assert lidar.endswith("Hz, best_effort")


def _no_groups_topics() -> list[Frame]:
    """Topics that no group can take, each for another reason."""
    at_100_ms = [BEGIN + n * 100 * MS for n in range(50)]
    return merged(
        [Frame("/text", STRING, time, serialize(STRING, "x")) for time in at_100_ms],
        [Frame("/unset", VECTOR, time, vector(0)) for time in at_100_ms],
        [Frame("/unset_once", VECTOR, time, vector(0 if n == 3 else time)) for n, time in enumerate(at_100_ms[:10])],
        [Frame("/stuck", VECTOR, time, vector(BEGIN)) for time in at_100_ms],
        [Frame("/diagnostics", DIAGNOSTICS, time, serialize(DIAGNOSTICS, header(time), [])) for time in at_100_ms],
        at("/rare", 1, 2, 3),
        jittery("/a<script>", period_ms=100, jitter_ms=3, count=50, seed=3),
    )


def test_every_topic_that_is_left_out_is_named_with_the_reason(tmp_path):
    bag = write_mcap(tmp_path / "rig.mcap", merged(_no_groups_topics(), _stereo_and_lidar()))
    text, sets = _proposed(bag)
    assert {topic.topic for group in load_text(text).groups for topic in group.topics} == {"/left", "/right", "/lidar"}
    assert sets["fused"] >= 49
    assert _left_out(bag) == {
        f"/a<script> ({VECTOR})": "a topic name may have only letters, digits, `_` and `/`, found `<` in `/a<script>`",
        f"/diagnostics ({DIAGNOSTICS})": "it carries diagnostics, not sensor data",
        f"/rare ({VECTOR})": "3 messages, at least 10 are needed",
        f"/stuck ({VECTOR})": "50 messages, all with the same stamp",
        f"/text ({STRING})": "its type has no header, so no stamp to match by",
        f"/unset ({VECTOR})": "50 messages, 50 with stamp 0",
        f"/unset_once ({VECTOR})": "10 messages, 1 with stamp 0",
    }


@pytest.mark.parametrize(
    ("type_name", "definition", "said"),
    [
        (
            "rcl_interfaces/msg/Log",
            None,
            "does not begin with a header; to match by a field of it, write `stamp: {field: stamp}`",
        ),
        (
            "robot/msg/Late",
            Definition("ros2msg", "uint8 number\nstd_msgs/Header header"),
            "does not begin with a header; to match by a field of it, write `stamp: {field: header.stamp}`",
        ),
        (
            "robot/msg/Shot",
            Definition("ros2msg", "builtin_interfaces/Time a\nuint8 number\nbuiltin_interfaces/Time b"),
            "does not begin with a header; to match by a field of it, write `stamp: {field: a}` or `stamp: {field: b}`",
        ),
        (STRING, None, "has no header, so no stamp to match by"),
        ("robot/msg/Unknown", None, "has no header, so no stamp to match by"),
    ],
)
def test_a_type_without_a_header_is_told_with_its_fields_of_time(type_name, definition, said):
    assert no_header(type_name, definition) == f"its type {said}"


def test_what_gives_no_set_with_the_others_is_named_too(tmp_path):
    early = jittery("/early", period_ms=100, jitter_ms=3, count=50, seed=3)
    late = [frame._replace(topic="/late", time=frame.time + 3_600_000 * MS) for frame in early]
    late = [frame._replace(payload=vector(frame.time)) for frame in late]
    with (
        closing(open_recording([str(write_mcap(tmp_path / "rig.mcap", [*early, *late]))])) as recording,
        pytest.raises(NothingToMatchError) as raised,
    ):
        propose(recording)
    said = [f"/early ({VECTOR}): none of its 50 messages forms a set with the others"]
    said += [f"/late ({VECTOR}): none of its 50 messages forms a set with the others"]
    assert str(raised.value).split("\n  ") == ["no two topics of the recording form a set", *said]


def test_of_a_topic_of_two_types_the_one_with_more_messages_is_taken(tmp_path):
    few = [frame._replace(type_name=POINT, payload=_point(frame.time)) for frame in at("/left", *range(0, 3000, 100))]
    first, second = tmp_path / "0.mcap", tmp_path / "1.mcap"
    write_mcap(first, few)
    write_mcap(second, _stereo_and_lidar())
    text, _ = _proposed(tmp_path)
    assert {topic.type for group in load_text(text).groups for topic in group.topics} == {VECTOR}
    why = f"recorded as several types; most messages are {VECTOR}"
    assert _left_out(tmp_path) == {f"/left ({POINT})": why}


def _point(stamp: int) -> bytes:
    return serialize(POINT, header(stamp), STORE.types["geometry_msgs/msg/Point"](0.0, 0.0, 0.0))
