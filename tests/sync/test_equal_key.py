from functools import partial

from syncrelay.sync import EqualKey
from tests.sync.support.timeline import drawn_cases

equal_key = partial(EqualKey, n_inputs=2, queue_size=3)

test_drawn = drawn_cases(
    {
        "messages of equal keys are a set, whatever their stamps": (
            equal_key,
            """
            left  |ab.....
            right |....A.B
            keys: aA bB
            -> A: aA
            -> B: bB
            """,
        ),
        "what is older than a set that leaves is superseded, on each input": (
            equal_key,
            """
            left  |ab.c.
            right |.D.B.
            keys: bB
            -> B: a superseded, D superseded, bB
            """,
        ),
        "older means stamps, not arrival": (
            equal_key,
            """
            left  |ab.
            right |..B
            keys: bB
            arrive: b a B
            -> B: a superseded, bB
            """,
        ),
    }
)
