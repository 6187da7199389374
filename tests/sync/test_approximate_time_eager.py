from functools import partial

import pytest

from syncrelay.sync import ApproximateTimeEager, Message
from tests.sync.support.drawn import policy_cases
from tests.sync.support.timeline import TICK_NS


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
        "the nearest message is taken, be it older": (
            eager,
            """
            lidar  |.a..b...
            camera |..A.....
            arrive: a b A
            -> A: aA
            """,
        ),
        "the nearest message is taken, be it newer": (
            eager,
            """
            lidar  |a..b....
            camera |..A.....
            arrive: a b A
            -> A: a superseded, bA
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
        "the earliest is given up for a later one only if that makes the set tighter": (
            three,
            """
            lidar  |.a.....b
            camera |...A.B..
            radar  |...r....
            arrive: a A b B r
            -> r: aAr
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
        "what is too far when it arrives goes by itself": (
            eager,
            """
            lidar  |A....
            camera |...bc
            arrive: b c A
            -> A: A too_far
            """,
        ),
        "an overflow may show that something else is too far": (
            partial(eager, 3, queue=2),
            """
            lidar  |..a....
            camera |...bcde
            radar  |.......
            -> d: b overflow
            -> e: c overflow, a too_far
            """,
        ),
        "a set that leaves may show that something else is too far": (
            partial(eager, 3),
            """
            lidar  |..ab.....
            camera |..A.....B
            radar  |..r......
            arrive: a A b B r
            -> r: aAr, b too_far
            """,
        ),
        "two inputs show that a message is too far while a third has nothing": (
            partial(eager, 3),
            """
            lidar  |ab.....
            camera |...C...
            radar  |.......
            -> C: a too_far
            """,
        ),
        "a later message of a stamp that is queued replaces the one before": (
            eager,
            """
            lidar  |a.
            lidar  |b.
            camera |.A
            camera |.B
            arrive: a b A B
            -> b: a duplicate
            -> A: bA
            """,
        ),
        "a single input is a set by itself": (
            partial(eager, 1),
            """
            lidar |ab
            -> a: a
            -> b: b
            """,
        ),
    }
)


def test_the_queue_that_was_needed_is_told_when_a_partner_has_overflowed():
    policy = eager(queue=5)
    for column in range(1, 21):
        policy.add(Message(0, column * TICK_NS, None))
    assert [policy.needed_queue(place) for place in (0, 1)] == [None, None]
    policy.add(Message(1, 8 * TICK_NS, None))
    assert [policy.needed_queue(place) for place in (0, 1)] == [14, None]
    longer = eager(queue=14)
    for column in range(1, 21):
        longer.add(Message(0, column * TICK_NS, None))
    assert longer.add(Message(1, 8 * TICK_NS, None))


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
