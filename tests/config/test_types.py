"""Types that a file leaves out: who says them then, and what is noted."""

import json

import pytest

from syncrelay.config import Severity, load_text

IMU = "sensor_msgs/msg/Imu"
A, B, C = {"topic": "/a"}, {"topic": "/b"}, {"topic": "/c"}


def file(**groups) -> str:
    return json.dumps(
        {"version": 1, "groups": {name: {"policy": "exact_time", "topics": topics} for name, topics in groups.items()}}
    )


def types_in(config) -> dict[str, list[str | None]]:
    return {group.name: [topic.type for topic in group.topics] for group in config.groups}


@pytest.mark.parametrize("own", ["/a", "a"])
def test_a_type_that_one_group_writes_is_the_topics_in_all(own):
    config = load_text(file(front=[A, B], back=[{"topic": own, "type": IMU}, C]), environ={})
    assert types_in(config) == {"front": [IMU, None], "back": [IMU, None]}


def test_what_nothing_tells_is_one_note_a_group():
    config = load_text(file(front=[A, {**B, "type": IMU}, C], back=[B, {"topic": "/d"}]), environ={})
    notes = [note for note in config.notes if note.code == "type_from_graph"]
    assert [(note.path, note.severity) for note in notes] == [
        ("groups.front.topics[0].topic", Severity.NOTE),
        ("groups.back.topics[1].topic", Severity.NOTE),
    ]
    assert notes[0].text == (
        "the types of `/a` and `/c` come from the graph when the relay runs, or from the recording, and cannot be"
        " checked here"
    )
    assert notes[1].text.startswith("the type of `/d` comes from the graph")
