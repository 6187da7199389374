from functools import partial

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
