"""What a message costs, in calls rather than seconds: the same on every machine."""

import gc
import random
import weakref

import pytest

from syncrelay.sync import ApproximateTime, ApproximateTimeEager, Message, SyncGroup
from tests.calls import Calls
from tests.faults.extent import chosen
from tests.sync.support.streams import MS, gappy, in_order

WIDE_NS = 10**15
POLICIES = [ApproximateTime, ApproximateTimeEager]


def calls_of_each(policy, events):
    """How many functions, Python's or C's, each event calls."""
    for index, stamp in events:
        with Calls() as calls:
            policy.add(Message(index, stamp, None))
        yield calls.count


@pytest.mark.parametrize("policy", POLICIES)
def test_no_event_costs_a_product_of_queues(policy):
    # 5 inputs with queues of 50: the products of a plain search go into the millions.
    for seed in chosen(short=[1], long=range(4)):
        events = gappy(random.Random(seed), 5, 1_000)
        for slop in (1_000 * MS, WIDE_NS):
            assert max(calls_of_each(policy(n_inputs=5, queue_size=50, slop_ns=slop), events)) < 600


@pytest.mark.parametrize("policy", POLICIES)
def test_a_longer_queue_costs_no_more(policy):
    for seed in range(chosen(short=1, long=3)):
        rng = random.Random(seed)
        n_inputs = rng.randint(2, 9)
        events = in_order(rng, n_inputs, 2_000)
        sizes = {"n_inputs": n_inputs, "slop_ns": 50 * MS}
        short, long = (sum(calls_of_each(policy(queue_size=queue, **sizes), events)) for queue in (10, 200))
        assert long < 1.3 * short


class Payload:
    """Something that can be seen to be alive."""


@pytest.mark.parametrize("policy", POLICIES)
def test_no_more_messages_are_kept_than_the_queues_hold(policy):
    queue_size, n_inputs = 5, 3
    group = SyncGroup(policy(n_inputs=n_inputs, queue_size=queue_size, slop_ns=50 * MS), required=(True,) * n_inputs)
    alive: weakref.WeakSet[Payload] = weakref.WeakSet()
    most = 0
    gc.disable()
    try:
        for index, stamp in in_order(random.Random(1), n_inputs, 3_000):
            payload = Payload()
            alive.add(payload)
            group.add(Message(index, stamp, payload), now=0)
            del payload
            most = max(most, len(alive))
    finally:
        gc.enable()
    assert queue_size < most <= n_inputs * queue_size
