from functools import partial

import pytest

from syncrelay.sync import ApproximateTimeEager, Message
from tests.sync.support.timeline import TICK_NS, policy_cases


def eager(inputs=2, queue=10, slop=2):
    return ApproximateTimeEager(n_inputs=inputs, queue_size=queue, slop_ns=slop * TICK_NS)


three = partial(eager, 3, slop=5)

test_drawn = policy_cases(
    {
        "a set leaves as soon as its last message arrives": (
            eager,
            """
            lidar  |a...bc
            camera |.A....C
            -> A: aA
            -> C: b superseded, cC
            """,
        ),
        "slop itself is within slop, slop 0 matches equal stamps": (
            partial(eager, slop=0),
            """
            lidar  |a.b
            camera |.AB
            -> A: a too_far
            -> b: A too_far
            -> B: bB
            """,
        ),
        "a message exactly slop away matches": (
            eager,
            """
            lidar  |a....
            camera |..A..
            -> A: aA
            """,
        ),
        "of two that are as near, the older is taken": (
            eager,
            """
            lidar  |a...b...
            camera |..A.....
            arrive: a b A
            -> A: aA
            """,
        ),
        "the tightest set is taken, not the first that fits": (
            three,
            """
            lidar  |.a.b.
            camera |.A..B
            radar  |...r.
            arrive: a A b B r
            -> r: a superseded, A superseded, bBr
            """,
        ),
        "sets never go back: what is older than a set is superseded": (
            eager,
            """
            lidar  |.ab.
            camera |..BC
            arrive: a b B C
            -> B: a superseded, bB
            """,
        ),
        "what lies further than slop before another input is too far, at once": (
            eager,
            """
            lidar  |ab..c
            camera |...B.
            -> B: a too_far, bB
            """,
        ),
    }
)


@pytest.mark.parametrize("column", [14, 15])
def test_a_message_that_finds_a_partner_needs_no_longer_queue(column):
    policy = eager(queue=5)
    for number in range(1, 21):
        policy.add(Message(0, number * TICK_NS, None))
    (match,) = policy.add(Message(1, column * TICK_NS, None))
    assert match.messages[0].stamp == 16 * TICK_NS
    assert policy.needed_queue(0) is None


def test_a_message_with_others_behind_it_does_not_ask_for_a_longer_queue():
    policy = eager(3, queue=5)
    for column in range(1, 21):
        policy.add(Message(0, column * TICK_NS, None))
    for column in (19, 8):
        policy.add(Message(1, column * TICK_NS, None))
    assert policy.needed_queue(0) is None


@pytest.mark.parametrize("wrong", [{"slop": -1}, {"queue": 0}, {"inputs": 0}])
def test_options_out_of_range_are_refused(wrong):
    with pytest.raises(ValueError, match="must be"):
        eager(**wrong)
