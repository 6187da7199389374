from functools import partial

import pytest

from syncrelay.sync import Drop, DropReason, ExactTime, Message
from tests.sync.support.timeline import policy_cases

exact = partial(ExactTime, n_inputs=2, queue_size=10)
three = partial(ExactTime, n_inputs=3, queue_size=10)

test_drawn = policy_cases(
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
        "what is older than a set that leaves is superseded, stamp by stamp": (
            exact,
            """
            left  |ab.d
            right |..CD
            -> D: a superseded, b superseded, C superseded, dD
            """,
        ),
        "a set may leave before an older one is complete, whose messages it supersedes": (
            exact,
            """
            left  |ab
            right |AB
            arrive: a b B A
            -> B: a superseded, bB
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


@pytest.mark.parametrize(
    ("index", "stamp"), [(0, 5), (1, 11)], ids=["the input that overflowed itself", "an input that comes between"]
)
def test_only_what_another_input_had_of_a_stamp_is_missed(index, stamp):
    policy = exact(queue_size=2)
    for lost_first in (10, 20, 30):
        policy.add(Message(0, lost_first, None))
    assert policy.add(Message(index, stamp, None)) == [Drop(Message(index, stamp, None), DropReason.OVERFLOW)]
    assert [policy.needed_queue(place) for place in (0, 1)] == [None, None]


@pytest.mark.parametrize("sizes", [{"n_inputs": 0}, {"queue_size": 0}])
def test_sizes_below_one_are_refused(sizes):
    with pytest.raises(ValueError, match="1 or more"):
        exact(**sizes)
