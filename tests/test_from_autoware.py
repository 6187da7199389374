"""What the page for users of Autoware shows does what it says, with lidars as Autoware's own tests have them."""

import random
import re
from pathlib import Path

import pytest

from syncrelay.config import load_text
from syncrelay.explain.dry_run import EngineDriver
from syncrelay.sync import Match, Message

_PAGE = (Path(__file__).parents[1] / "docs/howto/from_autoware.md").read_text()
_NAIVE, _ADVANCED = re.findall(r"^```yaml\n(version: 1\ngroups:\n  lidars:.*?)^```", _PAGE, re.DOTALL | re.MULTILINE)
# Of autoware_pointcloud_preprocessor's concatenate_and_time_sync_node.param.yaml, and of its strategy `advanced`.
_PARAMETERS = [
    "debug_mode",
    "rosbag_length",
    "maximum_queue_size",
    "timeout_sec",
    "is_motion_compensated",
    "publish_synchronized_pointcloud",
    "keep_input_frame_in_synchronized_pointcloud",
    "publish_previous_but_late_pointcloud",
    "synchronized_pointcloud_postfix",
    "input_twist_topic_type",
    "input_topics",
    "output_frame",
    "output_point_type",
    "matching_strategy",
    "lidar_timestamp_offsets",
    "lidar_timestamp_noise_window",
]
MS, BEGIN = 1_000_000, 10**18
OFFSETS = (0, 15 * MS, 16 * MS)
WINDOW = 10 * MS
TIMEOUT = 200 * MS
TURNS = 40


@pytest.mark.parametrize("parameter", _PARAMETERS)
def test_every_parameter_of_the_shipped_file_is_on_the_page(parameter):
    assert re.search(rf"`(matching_strategy\.)?{parameter}\b", _PAGE)


def _clouds(rng, away, *, by_arrival):
    """Clouds of three lidars of 10 Hz: each turn of each lidar within its window, sent in order, and its number."""
    clouds = []
    for lidar, offset in enumerate(OFFSETS):
        begin, end = away.get(lidar, (0, 0))
        for turn in range(TURNS):
            if not begin <= turn < end:
                stamp = BEGIN + turn * 100 * MS + offset + rng.randrange(WINDOW)
                received = stamp + rng.randrange(10 * MS)
                clouds.append((received, Message(lidar, received if by_arrival else stamp, received, key=turn)))
    return [message for _, message in sorted(clouds, key=lambda each: each[0])]


def _sets(text, clouds):
    left: list[tuple[int, Match]] = []

    def take(outcomes, now):
        left.extend((now, outcome) for outcome in outcomes if isinstance(outcome, Match))

    EngineDriver(load_text(text, environ={}).groups[0], take).run(clouds)
    return left


@pytest.mark.parametrize("text", [_NAIVE, _ADVANCED], ids=["naive", "advanced"])
@pytest.mark.parametrize("dead", [(), (0,), (1,), (2,), (0, 1), (0, 2), (1, 2)], ids=str)
def test_lidars_die_and_return_and_each_turn_is_one_set_of_those_that_are_there(text, dead):
    away = dict.fromkeys(dead, (10, 20))
    for seed in range(5):
        clouds = _clouds(random.Random(seed), away, by_arrival=text is _NAIVE)
        left = _sets(text, clouds)
        expected = [
            tuple(None if lidar in dead and 10 <= turn < 20 else turn for lidar in range(3)) for turn in range(TURNS)
        ]
        assert [tuple(each and each.key for each in match.messages) for _, match in left] == expected
        for now, match in left:
            received = [each.payload for each in match.messages if each is not None]
            # The timeout counts from the first cloud; a set of all leaves with the last.
            assert now <= min(received) + TIMEOUT
            if len(received) == len(OFFSETS):
                assert now == max(received)
        if text is _ADVANCED:
            assert all(match.stamp == min(each.stamp for each in match.messages if each) for _, match in left)


def test_with_a_narrower_window_a_cloud_is_in_a_set_if_it_is_nearer_than_both_windows():
    first = "top/pointcloud_before_sync, type: sensor_msgs/msg/PointCloud2, min_period: 60ms"
    windows, clouds, expected = (5 * MS, 10 * MS), [], []
    for turn in range(TURNS):
        apart = turn * MS // 2
        stamps = (BEGIN + turn * 100 * MS, BEGIN + turn * 100 * MS + OFFSETS[1] + apart)
        clouds += [Message(lidar, stamp, stamps[1] + MS, key=turn) for lidar, stamp in enumerate(stamps)]
        # What Autoware's own code compares; there, exactly that far apart is too far.
        is_near = abs(stamps[0] - (stamps[1] - OFFSETS[1])) <= sum(windows)
        expected += [(turn, turn, None)] if is_near else []
    left = _sets(_ADVANCED.replace(first, first + ", tolerance: 5ms"), clouds)
    sets = [tuple(each and each.key for each in match.messages) for _, match in left]
    assert [turns for turns in sets if None not in turns[:2]] == expected
    assert len(expected) == 31


def test_a_cloud_that_comes_after_its_set_is_in_none():
    clouds = _clouds(random.Random(1), {}, by_arrival=False)
    late = [
        each if each.input != 2 else Message(2, each.stamp, each.payload + 300 * MS, key=each.key) for each in clouds
    ]
    left = _sets(_ADVANCED, sorted(late, key=lambda each: each.payload))
    assert [tuple(each and each.key for each in match.messages) for _, match in left] == [
        (turn, turn, None) for turn in range(TURNS)
    ]
