from functools import partial

import pytest

from syncrelay.sync import DropReason, LatestTime, Message
from tests.sync.support.timeline import TICK_NS, play_policy, policy_cases


def latest(inputs=2, queue=10, age=3, **options):
    """Input 0 is the trigger."""
    max_ages_ns = [None if age is None else age * TICK_NS] * inputs
    return LatestTime(n_inputs=inputs, queue_size=queue, trigger=0, max_ages_ns=max_ages_ns, **options)


test_drawn = policy_cases(
    {
        "a trigger takes the latest message that is not newer, at once": (
            latest,
            """
            lidar |...a.b...c
            odom  |.AB...C...
            -> a: A superseded, aB
            -> b: bB
            -> c: cC
            """,
        ),
        "a slow input's message serves many sets": (
            partial(latest, age=None),
            """
            lidar |.abcd
            odom  |A....
            -> a: aA
            -> b: bA
            -> c: cA
            -> d: dA
            """,
        ),
        "a message of just the greatest age still serves": (
            latest,
            """
            lidar |...ab
            odom  |A....
            -> a: aA
            """,
        ),
        "a trigger waits for an input that has nothing for it yet": (
            latest,
            """
            lidar |.....a.
            odom  |A...B..
            arrive: A a B
            -> B: A superseded, aB
            """,
        ),
        "a trigger is too far when an input has shown newer messages only": (
            latest,
            """
            lidar |.a.b..c
            odom  |.....A.
            -> A: a too_far, b too_far
            -> c: cA
            """,
        ),
        "what no trigger can use any more expires": (
            latest,
            """
            lidar |.....a.b
            odom  |A......B
            -> B: a too_far, A expired, bB
            """,
        ),
        "a trigger never waits for an optional input": (
            partial(latest, 3, required=(True, True, False)),
            """
            lidar |..a.b......c
            odom  |.A........B.
            gps   |...G.......
            -> a: aA-
            -> b: bAG
            -> c: cB-
            """,
        ),
        "what is not newer than a message that has served is late": (
            latest,
            """
            lidar |..a
            odom  |.A.
            odom  |BC.
            arrive: A a B C
            -> a: aA
            -> B: B late
            -> C: C late
            """,
        ),
    }
)


def test_a_trigger_that_has_waited_enough_expires_and_the_next_is_served():
    policy = latest(age=3)
    left, _ = play_policy(policy, "lidar |.....ab\n odom |A......")
    assert left == ()
    assert (policy.waits_started, policy.waits_ended) == (2, 0)
    assert [drop.reason for drop in policy.release_oldest()] == [DropReason.EXPIRED] * 2
    assert (policy.waits_started, policy.waits_ended, policy.buffered(0), policy.buffered(1)) == (2, 1, 1, 0)


def test_when_a_trigger_expires_the_next_may_be_too_far():
    policy = latest(3, age=3)
    left, _ = play_policy(policy, "lidar |...a...b..\n odom |.A.......B\n gps |..........")
    assert left == ()
    told = [(drop.message.payload, drop.reason.value) for drop in policy.release_oldest()]
    assert told == [("a", "expired"), ("b", "too_far"), ("A", "expired")]
    assert (policy.waits_started, policy.waits_ended) == (2, 2)


def test_a_trigger_that_overflows_waits_no_longer():
    policy = latest(queue=2)
    for index, column in ((1, 6), (1, 7), (1, 8), (1, 9), (0, 10), (0, 11), (0, 12), (0, 13), (0, 14), (0, 15)):
        policy.add(Message(index, column * TICK_NS, None))
    # Two of the odometry's went, and of the triggers after 12, which find it too old, two wait.
    assert (policy.waits_started, policy.waits_ended, policy.buffered(0)) == (6, 4, 2)


@pytest.mark.parametrize("columns", [(5, 6, 7), (6, 7, 8, 9)], ids=["older", "of its stamp"])
def test_an_input_that_has_what_a_trigger_needs_needs_no_longer_queue(columns):
    policy = latest(3, queue=2)
    for column in columns:
        policy.add(Message(1, column * TICK_NS, None))
    for index, column in ((2, 9), (0, 8)):
        outcomes = policy.add(Message(index, column * TICK_NS, None))
    assert [drop.reason for drop in outcomes] == [DropReason.TOO_FAR]
    assert [policy.needed_queue(place) for place in (0, 1, 2)] == [None, None, None]


def test_a_queue_that_lost_only_what_was_too_old_was_long_enough():
    policy = latest(queue=5, age=1)
    for column in (1, 2, 3, 11, 12, 13, 14, 15):
        policy.add(Message(1, column * TICK_NS, None))
    policy.add(Message(0, 8 * TICK_NS, None))
    assert policy.needed_queue(1) is None


@pytest.mark.parametrize(
    "wrong",
    [
        {"trigger": -1},
        {"trigger": 2},
        {"required": (False, True)},
        {"required": (True,)},
        {"max_ages_ns": (None, -1)},
        {"max_ages_ns": (None,)},
        {"n_inputs": 0},
        {"queue_size": 0},
    ],
)
def test_options_out_of_range_are_refused(wrong):
    with pytest.raises(ValueError, match="must be"):
        LatestTime(**{"n_inputs": 2, "queue_size": 1, "trigger": 0, **wrong})
