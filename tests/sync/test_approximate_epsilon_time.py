from functools import partial

from syncrelay.sync import ApproximateEpsilonTime
from tests.sync.support.timeline import TICK_NS, drawn_cases


def epsilon_time(inputs=2, queue=10, epsilon=2):
    return ApproximateEpsilonTime(n_inputs=inputs, queue_size=queue, epsilon_ns=epsilon * TICK_NS)


test_drawn = drawn_cases(
    {
        "the oldest messages are a set if they lie within epsilon, itself included": (
            epsilon_time,
            """
            lidar  |a....b
            camera |..A..B
            -> A: aA
            -> B: bB
            """,
        ),
        "if not, the oldest is too far": (
            epsilon_time,
            """
            lidar  |ab...
            camera |...A.
            -> A: a too_far, bA
            """,
        ),
        "with it goes each input's oldest that is within epsilon of it": (
            partial(epsilon_time, 3, epsilon=5),
            """
            lidar  |a....b
            camera |....B.
            radar  |......r
            -> r: a too_far, B too_far
            """,
        ),
    }
)
