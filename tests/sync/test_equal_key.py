from functools import partial

import pytest

from syncrelay.sync import Drop, DropReason, EqualKey, Match, Message
from tests.sync.support.timeline import policy_cases

equal_key = partial(EqualKey, n_inputs=2, queue_size=3)

test_drawn = policy_cases(
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
        "messages of one stamp count by arrival": (
            equal_key,
            """
            left  |b..
            left  |a..
            right |.AB
            keys: aA bB
            arrive: b a A B
            -> A: b superseded, aA
            """,
        ),
        "a later message of a key that is queued replaces the one before": (
            equal_key,
            """
            left  |a.b.
            right |...A
            keys: abA
            -> b: a duplicate
            -> A: bA
            """,
        ),
    }
)


def test_stamps_may_be_unset():
    policy = equal_key()
    first, second = Message(0, 0, "a", key="one"), Message(0, 0, "b", key="two")
    other = Message(1, 0, "B", key="two")
    assert policy.add(first) == []
    assert policy.add(second) == []
    *drops, match = policy.add(other)
    assert drops == [Drop(first, DropReason.SUPERSEDED)]
    assert isinstance(match, Match)
    assert match.messages == (second, other)


def test_the_greatest_queue_that_was_needed_is_told():
    policy = equal_key(queue_size=1)
    for number in range(6):
        policy.add(Message(0, number, None, key=number))
    for key in (4, 1, 3):
        policy.add(Message(1, 0, None, key=key))
    assert policy.needed_queue(0) == 5


def test_only_so_many_lost_keys_are_remembered():
    policy = equal_key(queue_size=2)
    for number in range(24):
        policy.add(Message(0, number, None, key=number))
    policy.add(Message(1, 0, None, key=1))
    assert policy.needed_queue(0) is None
    policy.add(Message(1, 0, None, key=2))
    assert policy.needed_queue(0) == 22


def test_a_key_that_its_own_input_lost_asks_for_nothing():
    policy = equal_key(queue_size=1)
    for number in (1, 2, 1):
        policy.add(Message(0, number, None, key=number))
    assert policy.needed_queue(0) is None


@pytest.mark.parametrize("wrong", [{"n_inputs": 0}, {"queue_size": 0}])
def test_sizes_below_one_are_refused(wrong):
    with pytest.raises(ValueError, match="1 or more"):
        equal_key(**wrong)
