from functools import partial

from syncrelay.sync import LatestTime, SyncGroup
from tests.sync.support.timeline import TICK_NS, drawn_cases


def latest(inputs=2, age=3):
    """Input 0 is the trigger."""
    max_ages_ns = [None if age is None else age * TICK_NS] * inputs
    return LatestTime(n_inputs=inputs, queue_size=10, trigger=0, max_ages_ns=max_ages_ns)


def waiting(max_wait, inputs=2, **options):
    return SyncGroup(latest(inputs), max_wait_ns=max_wait and max_wait * TICK_NS, **options)


test_drawn = drawn_cases(
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
        "a trigger that has waited enough expires, and the next is served": (
            partial(waiting, 8),
            """
            lidar |.....ab...........
            odom  |A.......B.........
            arrive: A a b B
            -> B: a too_far, A expired, b too_far
            """,
        ),
        "when a trigger expires, the next may be too far": (
            partial(waiting, 8, 3),
            """
            lidar |...a...b....
            odom  |.A.......B..
            gps   |............
            -> @11: a expired, b too_far, A expired
            """,
        ),
        "a trigger never waits for an optional input": (
            partial(waiting, None, 3, required=(True, True, False)),
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
