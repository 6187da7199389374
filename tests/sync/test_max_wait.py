"""How long a message may wait, drawn; whatever the clock does."""

from functools import partial

import pytest

from syncrelay.sync import (
    Message,
)
from tests.sync.support.grouped import approximate, exact, latest
from tests.sync.support.timeline import TICK_NS, group_cases, stamp

test_max_wait = group_cases(
    {
        "the best set so far leaves max_wait after it was complete": (
            partial(approximate, max_wait=3),
            """
            lidar  |a........b
            camera |.A.......B...
            -> @4: aA
            -> B: bB
            """,
        ),
        "the wait counts from the first complete set, not from a better one": (
            partial(approximate, 3, max_wait=6),
            """
            lidar  |a..b........
            camera |..A.........
            radar  |..R.........
            -> b: a superseded, bAR
            """,
        ),
        "a set that is proved leaves before": (
            partial(approximate, max_wait=6),
            """
            lidar  |a...b.......
            camera |.A..........
            -> b: aA
            """,
        ),
        "the set after one that leaves waits anew": (
            partial(approximate, max_wait=4),
            """
            lidar  |a..b..........
            camera |.A...B........
            -> b: aA
            -> @9: bB
            """,
        ),
        "also if one message ends the one wait and begins the other": (
            partial(approximate, max_wait=8),
            """
            lidar  |a....b.........
            camera |.A....B........
            arrive: a A B b
            -> b: aA
            -> @14: bB
            """,
        ),
        "nothing waits any more when an overflow has left no set": (
            partial(approximate, queue=2, max_wait=9),
            """
            lidar  |a............
            camera |.ABC.........
            -> C: A overflow, a too_far
            """,
        ),
        "a max_wait of 0 lets a set leave with the message that completes it": (
            partial(approximate, max_wait=0),
            """
            lidar  |a....b
            camera |.A....B
            -> A: aA
            -> B: bB
            """,
        ),
        "a trigger of latest_time expires": (
            latest,
            """
            lidar |.....a..b.....
            odom  |A..........B..
            -> @9: a expired, A expired
            -> B: b too_far
            """,
        ),
        "each trigger has a wait of its own": (
            latest,
            """
            lidar |.ab...c......
            odom  |.............
            -> @5: a expired
            -> @6: b expired
            -> @10: c expired
            """,
        ),
    }
)


def test_the_clock_may_fall_while_a_set_waits():
    group = approximate(max_wait=3)
    group.add(Message(0, stamp(0), "a"), now=100 * TICK_NS)
    group.add(Message(1, stamp(1), "A"), now=100 * TICK_NS)
    assert group.next_deadline() == 103 * TICK_NS
    assert list(group.expire(now=10 * TICK_NS)) == []
    assert group.next_deadline() == 13 * TICK_NS
    assert list(group.expire(now=13 * TICK_NS - 1)) == []
    (match,) = group.expire(now=13 * TICK_NS)
    assert [message.payload for message in match.messages] == ["a", "A"]


def test_what_is_due_leaves_before_what_is_added():
    group = exact(inputs=2, required=(True, False), max_wait=3)
    group.add(Message(0, stamp(0), "a"), now=0)
    late, on_time = group.add(Message(0, stamp(9), "b"), now=3 * TICK_NS), group.next_deadline()
    assert [match.messages[0].payload for match in late] == ["a"]
    assert on_time == 6 * TICK_NS
    (match,) = group.add(Message(1, stamp(9), "B"), now=6 * TICK_NS)
    assert match.messages[1] is None, "B came too late for b"


@pytest.mark.parametrize("max_wait", [None, 3])
def test_no_message_is_needed_for_a_deadline(max_wait):
    group = approximate(max_wait=max_wait)
    assert group.next_deadline() is None
    assert list(group.expire(now=0)) == []
