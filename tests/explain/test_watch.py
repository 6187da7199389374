"""A group of a file under observation: what the file says of it becomes facts."""

import pytest

from syncrelay.clock import Step
from syncrelay.config import load_text
from syncrelay.explain import ClockState, Endpoint, GroupWatch, InputGraph, Refusal, Tolerance
from syncrelay.sync.counts import InputCounts
from tests.explain.support.groups import BEGAN, IMAGE, MS, S
from tests.ros.configs import config

REFUSAL = Refusal("publish", "/front/lidar", IMAGE, held_as="std_msgs/msg/Int64")
GRAPH = (
    InputGraph("/camera", "/front/camera", publishers=(Endpoint("/usb_cam", IMAGE),), alike=("/cam",), lost=3),
    InputGraph("/lidar", "/front/lidar", not_importable="no such package", refusal=REFUSAL),
)


def watch(**options):
    topics = [{"topic": "/camera", "type": IMAGE}, {"topic": "/lidar", "type": IMAGE, **options.pop("lidar", {})}]
    group = {"policy": "approximate_time", "topics": topics, **options}
    return GroupWatch(load_text(config({"front": group}), environ={}).groups[0], began=BEGAN)


def facts(**options):
    return watch(**options).facts(GRAPH, now=BEGAN + S)


SLOP, KEYED = Tolerance("slop", 20 * MS), {"policy": "equal_key", "key": "header.frame_id"}
LATEST = {"policy": "latest_time", "trigger": "/lidar"}


@pytest.mark.parametrize(
    ("options", "tolerance", "trigger", "held", "by_stamp"),
    [
        ({"policy": "exact_time"}, Tolerance("slop", 0, "approximate_time"), None, False, True),
        *(
            ({"policy": policy, "slop": "20ms"}, SLOP, None, False, True)
            for policy in ("approximate_time", "approximate_time_eager", "approximate_epsilon_time")
        ),
        (LATEST, None, 1, True, True),
        ({**LATEST, "max_age": "500ms"}, Tolerance("max_age", 500 * MS), 1, True, True),
        (KEYED, None, None, False, False),
    ],
)
def test_what_a_policy_goes_by_becomes_facts(options, tolerance, trigger, held, by_stamp):
    found = facts(**options)
    assert (found.tolerance, found.trigger, found.by_stamp) == (tolerance, trigger, by_stamp)
    assert (found.is_held(0), found.is_held(1)) == (held, False)
    assert trigger is None or found.pacemaker.name == "/lidar"


def test_the_keys_of_the_file_become_facts():
    options = {"slop": "20ms", "queue_size": 7, "every": 3, "max_rate": "5 Hz", "max_wait": "1s"}
    found = facts(**options, lidar={"offset": "-12ms", "required": False})
    assert (found.name, found.policy, found.queue_size) == ("front", "approximate_time", 7)
    assert (found.every, found.least_period, found.max_wait) == (3, 200 * MS, S)
    assert [(each.name, each.offset, each.required) for each in found.inputs] == [
        ("/camera", 0, True),
        ("/lidar", -12 * MS, False),
    ]


def test_what_came_becomes_facts_with_the_newest_keys():
    group = watch(**KEYED)
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
    group = watch(policy="exact_time")
    came = [(5 * S + n * 100 * MS, BEGAN + n * 100 * MS + 7 * MS) for n in range(10)]
    counts = group.config.engine().counts()
    group.add([came, came], [], counts, 0, by_clock=lambda received: received - BEGAN + 5 * S, now=BEGAN + S)
    simulated = ClockState(received=True)
    assert group.facts(GRAPH, now=BEGAN + S, clock=simulated).lag(0) == 7 * MS
    assert group.facts(GRAPH, now=BEGAN + S, clock=ClockState(received=False)).lag(0) is None


def test_what_came_before_this_machines_clock_was_set_forward_is_forgotten():
    made, nothing = watch(slop="20ms"), InputCounts(0, 0, {}, 0)
    made.add([[(BEGAN, BEGAN)]] * 2, [], [nothing] * 2, 0, now=BEGAN + S)
    now = BEGAN + 3600 * S
    # The clock was set once, however often that is said.
    for came, at in (([(BEGAN, BEGAN + S), (now, now - MS)], now), ([], now + S)):
        made.add([came] * 2, [], [nothing] * 2, 0, clock_set=Step(now, 3599 * S), now=at)
    found = made.facts(GRAPH, now=now + S)
    assert [list(each.figures.received) for each in found.inputs] == [[now - MS]] * 2
    assert found.figures.began == now


def test_the_look_that_sees_a_clock_set_forward_gives_the_rate_of_what_came_since():
    made, now = watch(slop="20ms"), BEGAN + 3600 * S
    made.add([[]] * 2, [], [InputCounts(0, 0, {}, 0)] * 2, 0, now=BEGAN + S)
    came = [(now - n * 100 * MS, now - n * 100 * MS) for n in range(9, -1, -1)]
    made.add([came] * 2, [], [InputCounts(10, 0, {}, 10)] * 2, 0, clock_set=Step(now, 3599 * S), now=now)
    assert [each.figures.rate_hz for each in made.facts(GRAPH, now=now).inputs] == [10] * 2
