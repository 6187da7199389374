from functools import partial

import pytest

from syncrelay.sync import Drop, DropReason, ExactTime, Message
from tests.sync.support.drawn import policy_cases

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
        "the oldest stamp overflows even if it arrives last": (
            partial(exact, queue_size=2),
            """
            left  |.bc
            right |A..
            arrive: b c A
            -> A: A overflow
            """,
        ),
        "a later message of a stamp replaces the one before": (
            exact,
            """
            left  |a
            left  |b
            right |A
            arrive: a b A
            -> b: a duplicate
            -> A: bA
            """,
        ),
        "a single input is a set by itself": (
            partial(exact, n_inputs=1),
            """
            left |ab
            -> a: a
            -> b: b
            """,
        ),
    }
)


def test_the_queue_that_was_needed_is_told_when_a_partner_has_overflowed():
    policy = exact(queue_size=3)
    for stamp in range(1, 11):
        policy.add(Message(0, stamp, None))
    assert [policy.needed_queue(place) for place in (0, 1)] == [None, None]
    policy.add(Message(1, 5, None))
    # Stamps 5 to 10 are six, and one more is on the safe side.
    assert [policy.needed_queue(place) for place in (0, 1)] == [7, None]


@pytest.mark.parametrize(
    ("index", "stamp"), [(0, 5), (1, 11)], ids=["the input that overflowed itself", "an input that comes between"]
)
def test_only_what_another_input_had_of_a_stamp_is_missed(index, stamp):
    policy = exact(queue_size=2)
    for lost_first in (10, 20, 30):
        policy.add(Message(0, lost_first, None))
    assert policy.add(Message(index, stamp, None)) == [Drop(Message(index, stamp, None), DropReason.OVERFLOW)]
    assert [policy.needed_queue(place) for place in (0, 1)] == [None, None]


def test_a_queue_of_the_needed_length_would_have_matched():
    policy = exact(queue_size=7)
    for stamp in range(1, 11):
        policy.add(Message(0, stamp, None))
    assert len(policy.add(Message(1, 5, None))) > 0


@pytest.mark.parametrize("sizes", [{"n_inputs": 0}, {"queue_size": 0}])
def test_sizes_below_one_are_refused(sizes):
    with pytest.raises(ValueError, match="1 or more"):
        exact(**sizes)
