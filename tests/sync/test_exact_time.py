from functools import partial

from syncrelay.sync import ExactTime
from tests.sync.support.timeline import drawn_cases

exact = partial(ExactTime, n_inputs=2, queue_size=10)
three = partial(ExactTime, n_inputs=3, queue_size=10)

test_drawn = drawn_cases(
    {
        "equal stamps on all inputs are a set, at once": (
            three,
            """
            left   |a..b
            right  |A..B
            centre |.x.y
            -> y: a superseded, A superseded, x superseded, bBy
            """,
        ),
        "a set may leave before an older one is complete, whose messages it supersedes": (
            exact,
            """
            left  |ab
            right |AB
            arrive: a b B A
            -> B: a superseded, bB
            -> A: A late
            """,
        ),
        "the limit is on distinct stamps over all inputs, and the oldest overflows": (
            partial(exact, queue_size=2),
            """
            left  |a.c.
            right |.B.D
            -> c: a overflow
            -> D: B overflow
            """,
        ),
    }
)
