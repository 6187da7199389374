from functools import partial

from syncrelay.sync import ApproximateTimeEager, DropReason, EqualKey, ExactTime, LatestTime, Message, SyncGroup
from tests.sync.support.timeline import START_NS, TICK_NS, group_cases, stamp


def grouped(policy, *, period=None, required=(True, True), **options):
    min_set_period_ns = None if period is None else period * TICK_NS
    return SyncGroup(policy, required=required, min_set_period_ns=min_set_period_ns, **options)


def exact(**options):
    return grouped(ExactTime(n_inputs=2, queue_size=9), **options)


def latest(**options):
    return grouped(LatestTime(n_inputs=2, queue_size=9, trigger=0), **options)


GAP = "." * 101
"""More than a second."""

test_drawn = group_cases(
    {
        "every third set passes, the first first, and of the others no message": (
            partial(exact, every=3),
            """
            left  |abcd
            right |ABCD
            -> A: aA
            -> B: b thinned, B thinned
            -> C: c thinned, C thinned
            -> D: dD
            """,
        ),
        "one set passes in each period": (
            partial(exact, period=2),
            """
            left  |abcde
            right |ABCDE
            -> A: aA
            -> B: b thinned, B thinned
            -> C: cC
            -> D: d thinned, D thinned
            -> E: eE
            """,
        ),
        "periods are counted from the first set, so what passes is spread evenly": (
            partial(exact, period=4),
            """
            left  |.a..b..c..d..e..
            right |.A..B..C..D..E..
            -> A: aA
            -> B: bB
            -> C: c thinned, C thinned
            -> D: dD
            -> E: eE
            """,
        ),
        "a set up to a fourth of a period early counts for the next one": (
            partial(exact, period=4),
            """
            left  |a..b...c
            right |A..B...C
            -> A: aA
            -> B: bB
            -> C: cC
            """,
        ),
        "after a jump the next set is the first": (
            partial(exact, every=2),
            f"""
            left  |b{GAP}a
            right |B{GAP}A
            arrive: a A b B
            -> A: aA
            -> B: bB
            """,
        ),
        "a set that did not pass was a set: what is older is late": (
            partial(exact, every=2),
            """
            left  |a.bc
            right |A.B.
            left  |.d..
            arrive: a A b B d c
            -> A: aA
            -> B: b thinned, B thinned
            -> d: d late
            """,
        ),
        "a message that serves many sets is thinned when it can be in none that passes": (
            partial(latest, every=3),
            """
            lidar |.a.b.c.d.e
            odom  |A.B.C.D.E.
            -> a: aA
            -> c: b thinned, B thinned
            -> d: c thinned, C thinned, dD
            """,
        ),
        "and not if it was in one that passed": (
            partial(latest, every=2),
            """
            lidar |.ab.c
            odom  |A..B.
            -> a: aA
            -> c: b thinned, cB
            """,
        ),
    }
)


def test_what_is_withheld_is_buffered_until_it_is_known():
    group = latest(every=2)
    for index, column in ((1, 0), (0, 1), (1, 2), (0, 3)):
        group.add(Message(index, stamp(column), column), now=0)
    assert [(counts.matched, counts.buffered) for counts in group.counts()] == [(1, 1), (1, 1)]
    drops = group.flush(DropReason.SHUTDOWN)
    assert [drop.message.payload for drop in drops] == [3, 2]
    assert [counts.buffered for counts in group.counts()] == [0, 0]


def test_a_message_that_passed_before_a_flush_may_come_again_after_it():
    group = latest(every=1, period=1)
    for _ in range(2):
        group.add(Message(1, stamp(0), "A"), now=0)
        (match,) = group.add(Message(0, stamp(1), "a"), now=0)
        assert len(match.messages) == 2
        group.flush(DropReason.TIME_JUMP)
    assert [counts.matched for counts in group.counts()] == [2, 2]


def test_what_passed_before_a_flush_is_not_known_after_it():
    policy = LatestTime(n_inputs=2, queue_size=9, trigger=0, max_ages_ns=[2 * TICK_NS] * 2)
    group = SyncGroup(policy, required=(True, False), max_wait_ns=0, every=2)
    for index, column in ((1, 5), (0, 6)):
        group.add(Message(index, stamp(column), column), now=0)
    group.flush(DropReason.TIME_JUMP)
    for index, column in ((0, 3), (1, 5), (0, 6)):
        group.add(Message(index, stamp(column), column), now=0)
    assert [(counts.matched, counts.buffered) for counts in group.counts()] == [(2, 1), (1, 1)]


def test_sets_without_stamps_are_thinned_by_the_clock():
    group = grouped(EqualKey(n_inputs=2, queue_size=9), period=2)
    passed = []
    for tick in range(6):
        now = START_NS + tick * TICK_NS
        group.add(Message(0, 0, tick, key=tick), now=now)
        passed += [
            tick for outcome in group.add(Message(1, 0, tick, key=tick), now=now) if hasattr(outcome, "messages")
        ]
    assert passed == [0, 2, 4]


def test_the_period_is_of_the_stamps_that_sets_are_matched_by():
    group = exact(period=2, offsets_ns=(0, 10 * TICK_NS))
    for column in range(4):
        group.add(Message(0, stamp(column), None), now=0)
        group.add(Message(1, stamp(column - 10), None), now=0)
    assert group.sets == 2


def test_the_period_is_of_the_latest_required_stamp_of_a_set():
    # Both sets end within a period of each other, but for their earliest stamps, the optional one, or no offset.
    policy = ApproximateTimeEager(n_inputs=3, queue_size=9, slop_ns=3 * TICK_NS)
    offsets_ns = (0, 10 * TICK_NS, 0)
    group = grouped(policy, period=4, required=(True, True, False), max_wait_ns=0, offsets_ns=offsets_ns)
    for index, column in ((0, 0), (1, 3), (2, 7), (0, 4), (1, 5)):
        group.add(Message(index, stamp(column) - offsets_ns[index], None), now=0)
    assert group.sets == 1
    assert [counts.dropped for counts in group.counts()] == [{DropReason.THINNED: 1}] * 3
