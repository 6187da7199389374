"""Values that are written into a file, without a change of anything else."""

import pytest

from syncrelay.recordings.analysis.changes import Change, file_with_changes, patch, with_changes

_FILE = """\
version: 1
groups:
  front:  # what the robot sees
    policy: approximate_time
    slop: 10ms            # measured in May
    age_penalty: 0.2
    topics:
      - topic: /a         # the camera
        type: x/msg/Y
        min_period: "9ms"
      - {topic: /b, type: x/msg/Y}
"""


def test_changes_keep_comments_quotes_and_order():
    changes = [
        Change("front", None, "slop", "25ms", "wider"),
        Change("front", None, "queue_size", 40, "longer"),
        Change("front", 1, "min_period", "8ms", "sooner"),
    ]
    assert with_changes(_FILE, changes) == _FILE.replace("slop: 10ms ", "slop: 25ms ").replace(
        "    topics:\n", "    queue_size: 40  # longer\n    topics:\n"
    ).replace("type: x/msg/Y}", "type: x/msg/Y, min_period: 8ms}")


def test_changes_keep_the_line_breaks_of_a_file():
    changed = with_changes(_FILE.replace("\n", "\r\n"), [Change("front", None, "slop", "25ms", "")])
    assert changed == _FILE.replace("slop: 10ms", "slop: 25ms").replace("\n", "\r\n")


def test_a_patch_holds_the_changes_alone():
    changes = [Change("front", None, "slop", "25ms", ""), Change("front", 1, "stamp", "receive", "")]
    assert patch(changes, {"front": ["/a", "/b"]}) == (
        "groups:\n  front:\n    slop: 25ms\n    topics:\n      - topic: /b\n        stamp: receive\n"
    )


_SHARED = """\
version: 1
x-base: &base
  policy: approximate_time
  slop: 20ms # of all
groups:
  front:
    <<: *base
    topics:
      - {topic: /a, type: sensor_msgs/msg/Image}
      - {topic: /b, type: sensor_msgs/msg/Image}
  rear: &rear
    <<: *base
    topics: &topics
      - {topic: /a, type: sensor_msgs/msg/Image}
      - {topic: /b, type: sensor_msgs/msg/Image}
  third:
    <<: *base
    topics: *topics
  fourth:
    <<: *rear
"""


@pytest.mark.parametrize("group", ["front", "third", "fourth"])
def test_a_merged_value_is_changed_in_the_group_alone(group: str):
    changed = file_with_changes(_SHARED, [Change(group, None, "slop", "25ms", "better")])
    assert [line for line in changed.splitlines() if line not in _SHARED.splitlines()] == ["    slop: 25ms  # better"]
    begin = changed.index(f"  {group}:")
    assert begin < changed.index("slop: 25ms") == changed.index("slop: 25ms", begin)
