"""A group of a file under observation: what the file says of it becomes facts."""

import pytest

from syncrelay.config import load_text
from syncrelay.explain import ClockState, Endpoint, GroupWatch, InputGraph, Refusal, Tolerance
from syncrelay.sync.counts import InputCounts
from tests.explain.support.groups import BEGAN, IMAGE, MS, S

REFUSAL = Refusal("publish", "/front/lidar", IMAGE, held_as="std_msgs/msg/Int64")
GRAPH = (
    InputGraph("/camera", "/front/camera", publishers=(Endpoint("/usb_cam", IMAGE),), alike=("/cam",), lost=3),
    InputGraph("/lidar", "/front/lidar", not_importable="no such package", refusal=REFUSAL),
)


def watch(keys, topic=""):
    text = f"""
version: 1
groups:
  front:
    {keys}
    topics:
      - {{topic: /camera, type: {IMAGE}}}
      - {{topic: /lidar, type: {IMAGE}{topic}}}
"""
    return GroupWatch(load_text(text).groups[0], began=BEGAN)


def facts(keys, topic=""):
    return watch(keys, topic).facts(GRAPH, now=BEGAN + S)


@pytest.mark.parametrize(
    ("keys", "tolerance"),
    [
        ("policy: exact_time", Tolerance("slop", 0, "approximate_time")),
        ("{policy: approximate_time, slop: 20ms}", Tolerance("slop", 20 * MS)),
        ("{policy: approximate_time_eager, slop: 20ms}", Tolerance("slop", 20 * MS)),
        ("{policy: approximate_epsilon_time, slop: 20ms}", Tolerance("slop", 20 * MS)),
        ("{policy: latest_time, trigger: /camera}", None),
        ("{policy: latest_time, trigger: /camera, max_age: 500ms}", Tolerance("max_age", 500 * MS)),
        ("{policy: equal_key, key: header.frame_id}", None),
    ],
)
def test_each_policy_has_its_tolerance(keys, tolerance):
    lines = keys.strip("{}").replace(", ", "\n    ")
    assert facts(lines).tolerance == tolerance


def test_a_trigger_is_an_index_and_the_others_are_held():
    found = facts("policy: latest_time\n    trigger: /lidar")
    assert (found.trigger, found.is_held(0), found.is_held(1)) == (1, True, False)
    assert found.pacemaker.name == "/lidar"


def test_without_a_trigger_nothing_is_held():
    found = facts("policy: exact_time")
    assert (found.trigger, found.is_held(0)) == (None, False)


@pytest.mark.parametrize(
    ("keys", "by_stamp"), [("policy: exact_time", True), ("policy: equal_key\n    key: header.frame_id", False)]
)
def test_only_keys_are_matched_whatever_the_stamps(keys, by_stamp):
    assert facts(keys).by_stamp is by_stamp


def test_the_keys_of_the_file_become_facts():
    keys = "policy: approximate_time\n    slop: 20ms\n    queue_size: 7\n    every: 3"
    keys += "\n    max_rate: 5 Hz\n    max_wait: 1s"
    found = facts(keys, ", offset: -12ms, required: false")
    assert (found.name, found.policy, found.queue_size) == ("front", "approximate_time", 7)
    assert (found.every, found.least_period, found.max_wait) == (3, 200 * MS, S)
    assert [(each.name, each.offset, each.required) for each in found.inputs] == [
        ("/camera", 0, True),
        ("/lidar", -12 * MS, False),
    ]


def test_the_graph_becomes_facts():
    camera, lidar = facts("policy: exact_time").inputs
    assert (camera.output, camera.graph.publishers, camera.graph.alike, camera.graph.lost) == (
        "/front/camera",
        (Endpoint("/usb_cam", IMAGE),),
        ("/cam",),
        3,
    )
    assert (lidar.graph.not_importable, lidar.graph.refusal) == ("no such package", REFUSAL)


def test_what_came_becomes_facts_with_the_newest_keys():
    group = watch("policy: equal_key\n    key: header.frame_id")
    counts = (InputCounts(1, 0, {}, 1), InputCounts(0, 0, {}, 0))
    group.add([[(BEGAN, BEGAN + MS)], []], [], counts, 0, keys=("k7", None), now=BEGAN + S)
    found = group.facts(
        GRAPH, now=BEGAN + S, clock=ClockState(received=True, stopped=4 * S), waited=5, failure="KeyError: 7"
    )
    assert [each.counts for each in found.inputs] == list(counts)
    assert [each.key for each in found.inputs] == ["k7", None]
    assert found.inputs[0].figures.delay == MS
    assert (found.clock and found.clock.stopped, found.waited, found.failure) == (4 * S, 5, "KeyError: 7")


def test_how_late_messages_are_is_told_by_one_clock():
    group = watch("policy: exact_time")
    came = [(5 * S + n * 100 * MS, BEGAN + n * 100 * MS + 7 * MS) for n in range(10)]
    counts = group.config.engine().counts()
    group.add([came, came], [], counts, 0, by_clock=lambda received: received - BEGAN + 5 * S, now=BEGAN + S)
    simulated = ClockState(received=True)
    assert group.facts(GRAPH, now=BEGAN + S, clock=simulated).lag(0) == 7 * MS
    assert group.facts(GRAPH, now=BEGAN + S, clock=ClockState(received=False)).lag(0) is None
