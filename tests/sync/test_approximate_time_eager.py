from functools import partial

from syncrelay.sync import ApproximateTimeEager
from tests.sync.support.timeline import TICK_NS, drawn_cases


def eager(inputs=2, queue=10, slop=2):
    return ApproximateTimeEager(n_inputs=inputs, queue_size=queue, slop_ns=slop * TICK_NS)


three = partial(eager, 3, slop=5)

test_drawn = drawn_cases(
    {
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
    }
)
