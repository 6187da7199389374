import pytest
from timeline import START_NS, TICK_NS, play_group

from syncrelay.sync import ApproximateTime, Drop, DropReason, ExactTime, Message, Restamp, SyncGroup


def exact_group(inputs=2, queue=10, **options):
    return SyncGroup(ExactTime(n_inputs=inputs, queue_size=queue), required=(True,) * inputs, **options)


CASES = {
    "older than what its input last gave is late, and so is as old": (
        """
        left  |a.b.
        left  |..c.
        right |..B.
        arrive: B b a c
        -> b: bB
        -> a: a late
        -> c: c late
        """
    ),
    "a stamp that falls by more than a second flushes the group": (
        f"""
        left  |d{"." * 100}ab
        right |D{"." * 101}B
        arrive: a b B d D
        -> B: a superseded, bB
        -> D: dD
        """
    ),
}


@pytest.mark.parametrize("drawing", CASES.values(), ids=CASES)
def test_drawn(drawing):
    left, drawn = play_group(exact_group(), drawing)
    assert left == drawn


def test_a_message_with_an_unset_stamp_is_dropped_as_unstamped():
    group = exact_group()
    message = Message(0, 0, "a")
    assert group.add(message, now=1) == (Drop(message, DropReason.UNSTAMPED),)


def test_offsets_count_for_matching_and_messages_leave_with_the_stamp_they_came_with():
    group = exact_group(offsets_ns=(0, -12_000_000))
    first, second = Message(0, START_NS, "a"), Message(1, START_NS + 12_000_000, "A")
    assert group.add(first, now=0) == ()
    (match,) = group.add(second, now=0)
    assert match.messages == (first, second)


@pytest.mark.parametrize(
    ("restamp", "expected"), [(None, None), (Restamp.EARLIEST, 0), (Restamp.LATEST, 3), (1, 3), (0, 0)]
)
def test_restamp_gives_the_set_a_common_stamp(restamp, expected):
    policy = ApproximateTime(n_inputs=2, queue_size=5, slop_ns=5 * TICK_NS)
    group = SyncGroup(policy, required=(True, True), restamp=restamp, offsets_ns=(0, -3 * TICK_NS))
    group.add(Message(0, START_NS, "a"), now=0)
    (match,) = group.add(Message(1, START_NS + 3 * TICK_NS, "A"), now=0)
    assert match.stamp == (None if expected is None else START_NS + expected * TICK_NS)


def test_counts_say_where_every_message_went():
    group = exact_group()
    for message in (
        Message(0, 1, ""),
        Message(0, 2, ""),
        Message(1, 2, ""),
        Message(0, 3, ""),
        Message(0, 1, ""),
    ):
        group.add(message, now=0)
    group.reject(Message(1, 0, ""), DropReason.MALFORMED)
    left, right = group.counts()
    assert (left.fed, left.matched, left.dropped, left.buffered) == (
        4,
        1,
        {DropReason.SUPERSEDED: 1, DropReason.LATE: 1},
        1,
    )
    assert (right.fed, right.matched, right.dropped, right.buffered) == (2, 1, {DropReason.MALFORMED: 1}, 0)
    assert group.sets == 1
