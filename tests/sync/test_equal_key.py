from functools import partial

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
