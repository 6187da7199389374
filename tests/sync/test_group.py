"""What all policies share, drawn: lateness, disorder, jumps, waiting."""

from functools import partial

import pytest
from drawn import group_cases
from timeline import START_NS, TICK_NS, play_group, stamp

from syncrelay.sync import (
    ApproximateEpsilonTime,
    ApproximateTime,
    ApproximateTimeEager,
    Drop,
    DropReason,
    EqualKey,
    ExactTime,
    InputCounts,
    LatestTime,
    Message,
    Restamp,
    SyncGroup,
)


def grouped(policy, required=None, max_wait=None, **options):
    return SyncGroup(
        policy,
        required=required or (True,) * policy.n_inputs,
        max_wait_ns=None if max_wait is None else max_wait * TICK_NS,
        **options,
    )


def exact(inputs=2, queue=10, **options):
    return grouped(ExactTime(n_inputs=inputs, queue_size=queue), **options)


def approximate(inputs=2, queue=10, slop=20, **options):
    return grouped(ApproximateTime(n_inputs=inputs, queue_size=queue, slop_ns=slop * TICK_NS), **options)


def paced(periods, *, slop, required):
    periods_ns = [period * TICK_NS for period in periods]
    policy = ApproximateTime(n_inputs=len(periods), queue_size=9, slop_ns=slop * TICK_NS, min_periods_ns=periods_ns)
    return grouped(policy, required=required, max_wait=9)


def eager(*, slop):
    policy = ApproximateTimeEager(n_inputs=3, queue_size=9, slop_ns=slop * TICK_NS)
    return grouped(policy, required=(True, True, False), max_wait=9)


def by_key(inputs=2, **options):
    return grouped(EqualKey(n_inputs=inputs, queue_size=3), **options)


def latest(max_wait=4):
    policy = LatestTime(n_inputs=2, queue_size=9, trigger=0, max_age_ns=3 * TICK_NS)
    return grouped(policy, max_wait=max_wait)


third_optional = {"inputs": 3, "required": (True, True, False)}
GAP = "." * 101
"""More than a second."""

test_disorder = group_cases(
    {
        "older than what its input last gave is late, and so is as old": (
            exact,
            """
            left  |a.b.
            left  |..c.
            right |..B.
            arrive: B b a c
            -> b: bB
            -> a: a late
            -> c: c late
            """,
        ),
        "older than what its input has, but not late, is used": (
            exact,
            """
            left  |ab
            right |A.
            arrive: b a A
            -> A: aA
            """,
        ),
        "by key, the stamp of what was given may come again": (
            by_key,
            """
            left  |.a..
            left  |cb..
            right |.A..
            right |.B..
            keys: aA bB
            arrive: a A b B c
            -> A: aA
            -> B: bB
            -> c: c late
            """,
        ),
        "a stamp that falls by more than a second flushes the group, which starts afresh": (
            exact,
            f"""
            left  |d.{GAP}abc
            right |D.{GAP}.B
            arrive: a b B c d D
            -> B: a superseded, bB
            -> d: c time_jump
            -> D: dD
            """,
        ),
        "a second is late, but no jump": (
            exact,
            f"""
            left  |d{GAP[2:]}a
            right |D{GAP[2:]}A
            arrive: a A d D
            -> A: aA
            -> d: d late
            -> D: D late
            """,
        ),
        "what other inputs still send of the time before is dropped": (
            exact,
            f"""
            left  |d.{GAP}ab.
            right |D.{GAP}A.B
            arrive: a A b d B D
            -> A: aA
            -> d: b time_jump
            -> B: B time_jump
            -> D: dD
            """,
        ),
        "but nothing that could belong to the new time": (
            exact,
            f"""
            left  |e.{GAP}ab{GAP}f
            right |..{GAP}A.{GAP}F
            arrive: a A b e f F
            -> A: aA
            -> e: b time_jump
            -> F: e superseded, fF
            """,
        ),
    }
)

test_max_wait = group_cases(
    {
        "the best set so far leaves max_wait after it was complete": (
            partial(approximate, max_wait=3),
            """
            lidar  |a........b
            camera |.A.......B...
            -> @4: aA
            -> B: bB
            """,
        ),
        "the wait counts from the first complete set, not from a better one": (
            partial(approximate, 3, max_wait=6),
            """
            lidar  |a..b........
            camera |..A.........
            radar  |..R.........
            -> b: a superseded, bAR
            """,
        ),
        "a set that is proved leaves before": (
            partial(approximate, max_wait=6),
            """
            lidar  |a...b.......
            camera |.A..........
            -> b: aA
            """,
        ),
        "the set after one that leaves waits anew": (
            partial(approximate, max_wait=4),
            """
            lidar  |a..b..........
            camera |.A...B........
            -> b: aA
            -> @9: bB
            """,
        ),
        "also if one message ends the one wait and begins the other": (
            partial(approximate, max_wait=8),
            """
            lidar  |a....b.........
            camera |.A....B........
            arrive: a A B b
            -> b: aA
            -> @14: bB
            """,
        ),
        "nothing waits any more when an overflow has left no set": (
            partial(approximate, queue=2, max_wait=9),
            """
            lidar  |a............
            camera |.ABC.........
            -> C: A overflow, a too_far
            """,
        ),
        "a max_wait of 0 lets a set leave with the message that completes it": (
            partial(approximate, max_wait=0),
            """
            lidar  |a....b
            camera |.A....B
            -> A: aA
            -> B: bB
            """,
        ),
        "a trigger of latest_time expires": (
            latest,
            """
            lidar |.....a..b.....
            odom  |A..........B..
            -> @9: a expired, A expired
            -> B: b too_far
            """,
        ),
        "each trigger has a wait of its own": (
            latest,
            """
            lidar |.ab...c......
            odom  |.............
            -> @5: a expired
            -> @6: b expired
            -> @10: c expired
            """,
        ),
    }
)

test_optional = group_cases(
    {
        "a set takes the optional message nearest to its middle, as soon as none can be nearer": (
            partial(approximate, **third_optional, slop=4, max_wait=5),
            """
            lidar  |....b....
            camera |....B....
            imu    |..v..w...
            -> w: v superseded, bBw
            """,
        ),
        "after max_wait it leaves with what there is": (
            partial(approximate, **third_optional, slop=4, max_wait=5),
            """
            lidar  |....b.....c......
            camera |....B.....C......
            imu    |...y.............
            -> @9: bBy
            -> @15: cC-
            """,
        ),
        "an optional message that is too far is not waited for once its input has shown a later one": (
            partial(approximate, **third_optional, slop=2, max_wait=9),
            """
            lidar  |....b......
            camera |....B......
            imu    |.x.....y...
            -> y: x too_far, bB-
            """,
        ),
        "the whole set is within slop, so one optional message may shut out another": (
            partial(approximate, 4, required=(True, True, False, False), slop=3, max_wait=9),
            """
            lidar  |...b...
            camera |...B...
            imu    |.x...v.
            gps    |.....y.
            -> y: bBx-
            """,
        ),
        "of two as near, the older is taken; what is older is superseded": (
            partial(approximate, **third_optional, slop=4, max_wait=9),
            """
            lidar  |...b...
            camera |...B...
            imu    |.wx.y..
            -> y: w superseded, bBx
            """,
        ),
        "a known least period decides sooner": (
            partial(paced, (0, 2), slop=4, required=(True, False)),
            """
            lidar |..b...
            imu   |.x....
            -> b: bx
            """,
        ),
        "unless a message after the least period would still fit": (
            partial(paced, (0, 5), slop=2, required=(True, False)),
            """
            lidar |....b......
            imu   |.x....y....
            -> y: x superseded, by
            """,
        ),
        "a known least period of required inputs still decides which of them go together": (
            partial(paced, (0, 2, 0), slop=3, required=(False, True, True)),
            """
            gps    |..g.
            lidar  |a...
            camera |.A..
            -> g: gaA
            """,
        ),
        "epsilon counts for them as slop does": (
            lambda: grouped(
                ApproximateEpsilonTime(n_inputs=3, queue_size=2, epsilon_ns=TICK_NS),
                required=(True, False, True),
                max_wait=9,
            ),
            """
            lidar  |a....b...
            imu    |.x......y
            camera |.A...B...
            -> A: axA
            -> y: b-B
            """,
        ),
        "slop counts from the ends of a set": (
            partial(eager, slop=4),
            """
            lidar  |..a.....
            camera |.....A..
            imu    |x......y
            -> y: x too_far, aA-
            """,
        ),
        "what another optional input has shut out goes when no later set could take it": (
            partial(approximate, 4, required=(True, True, False, False), slop=3, max_wait=9),
            """
            lidar  |...b....
            camera |...B....
            imu    |....v...
            gps    |x......y
            -> y: x too_far, bBv-
            """,
        ),
        "of two sets that wait, a message as near to both goes to the first": (
            partial(approximate, **third_optional, slop=5, max_wait=20),
            """
            lidar  |a...b..
            camera |A...B..
            gps    |..x....
            arrive: a A b B x
            -> x: aAx
            """,
        ),
        "of two sets that wait, a message goes to the nearer": (
            partial(approximate, **third_optional, slop=5, max_wait=20),
            """
            lidar  |a...b...
            camera |A...B...
            gps    |...x....
            gps    |......y.
            arrive: a A b B x y
            -> x: aA-
            -> y: bBx
            """,
        ),
        "sets leave in their order, and a later one waits for an earlier": (
            partial(exact, **third_optional, max_wait=6),
            """
            left  |a.b..........
            right |A.B..........
            depth |..x..........
            arrive: a A b x B
            -> x: aA-
            -> B: bBx
            """,
        ),
        "a late optional message is no use to a set that has left": (
            partial(exact, **third_optional, max_wait=2),
            """
            left  |a...c
            right |A...C
            depth |x.y.z
            arrive: a A y c C x z
            -> @2: aA-
            -> z: x superseded, y superseded, cCz
            """,
        ),
        "older than what it last gave is late for an optional input, too": (
            partial(exact, **third_optional, max_wait=2),
            """
            left  |.a
            right |.A
            depth |xy
            arrive: a A y x
            -> y: aAy
            -> x: x late
            """,
        ),
        "an optional queue overflows; a later message of a stamp replaces the one before": (
            partial(exact, **third_optional, queue=2, max_wait=2),
            """
            left  |.....
            right |.....
            depth |vwxy.
            depth |...z.
            arrive: v w x y z
            -> x: v overflow
            -> y: w overflow
            -> z: y duplicate
            """,
        ),
        "what a set that waits holds has been given: older is late": (
            partial(exact, **third_optional, max_wait=3),
            """
            left  |.b...
            right |.B...
            depth |.....
            left  |a....
            right |A....
            arrive: b B a A
            -> a: a late
            -> A: A late
            -> @4: bB-
            """,
        ),
        "more sets than a queue holds do not wait": (
            partial(exact, **third_optional, queue=2, max_wait=50),
            """
            left  |abc
            right |ABC
            depth |...
            -> C: aA-
            """,
        ),
        "a set waits for its best and for the optional no more than max_wait together": (
            partial(approximate, **third_optional, slop=4, max_wait=5),
            """
            lidar  |a.........
            camera |.A........
            imu    |..........
            -> @6: aA-
            """,
        ),
        "of two sets that one message completes, the first has waited longer": (
            partial(approximate, **third_optional, slop=4, max_wait=8),
            """
            lidar  |a....b........
            camera |.A...B........
            imu    |..............
            arrive: a A B b
            -> @9: aA-
            -> @13: bB-
            """,
        ),
        "a set that waits for optional inputs leaves in time while a later one is still open": (
            partial(approximate, **third_optional, slop=4, max_wait=8),
            """
            lidar  |a....b.........
            camera |.A....B........
            imu    |...............
            -> @9: aA-
            -> @14: bB-
            """,
        ),
        "a set that does not wait for optional inputs needs no max_wait": (
            lambda: grouped(
                LatestTime(n_inputs=3, queue_size=9, trigger=0, max_age_ns=2 * TICK_NS), required=(True, True, False)
            ),
            """
            lidar |..a.b...c
            odom  |.A.B...C.
            gps   |...G.....
            -> a: aA-
            -> b: bBG
            -> c: cC-
            """,
        ),
        "by key: the optional message of the key is waited for": (
            partial(by_key, **third_optional, max_wait=4),
            """
            left  |a.b.c.........
            right |A.B.C.........
            depth |.x...z........
            keys: aAx bBz cC
            -> x: aAx
            -> z: bBz
            -> @8: cC-
            """,
        ),
        "by key: of each optional input": (
            partial(by_key, 4, required=(True, True, False, False), max_wait=9),
            """
            left  |a....
            right |A....
            depth |.x...
            masks |...z.
            keys: aAxz
            -> z: aAxz
            """,
        ),
        "by key: at once where no input is optional": (
            partial(by_key, max_wait=9),
            """
            left  |a.
            right |.A
            keys: aA
            -> A: aA
            """,
        ),
        "by key: not once its input has shown the key of a later set": (
            partial(by_key, **third_optional, max_wait=9),
            """
            left  |ab....
            right |AB....
            depth |..wz..
            keys: aA bBz
            -> z: aA-, w superseded, bBz
            """,
        ),
        "by key: replaced, overflown, and not more waiting sets than a queue holds": (
            partial(by_key, **third_optional, max_wait=50),
            """
            left  |.....abcd
            right |.....ABCD
            depth |wxyzv....
            depth |....u....
            keys: aA bB cC dD vu
            -> z: w overflow
            -> v: x overflow
            -> u: v duplicate
            -> D: aA-
            """,
        ),
        "by key: older stamps are superseded with older arrivals": (
            partial(by_key, **third_optional, max_wait=50),
            """
            left  |...a
            right |...A
            depth |wxy.
            keys: aAx
            arrive: y x w a A
            -> A: y superseded, w superseded, aAx
            """,
        ),
    }
)


def test_an_unset_stamp_is_dropped_as_unstamped():
    group = exact()
    message = Message(0, 0, "a")
    assert group.add(message, now=1) == (Drop(message, DropReason.UNSTAMPED),)
    assert group.counts()[0].dropped == {DropReason.UNSTAMPED: 1}


def test_by_key_a_stamp_may_be_unset():
    group = by_key()
    for number in range(3):
        assert list(group.add(Message(0, 0, number, key=number), now=0)) == []
        (match,) = group.add(Message(1, 0, number, key=number), now=0)
        assert [message.payload for message in match.messages] == [number, number]
    assert [counts.matched for counts in group.counts()] == [3, 3]


def test_by_key_an_unset_stamp_is_no_jump_and_makes_nothing_less_late():
    group = by_key()
    for number, time in ((1, START_NS), (2, 0)):
        group.add(Message(0, time, number, key=number), now=0)
        (match,) = group.add(Message(1, time, number, key=number), now=0)
        assert [message.payload for message in match.messages] == [number, number]
    late = Message(0, START_NS - 1, 3, key=3)
    assert list(group.add(late, now=0)) == [Drop(late, DropReason.LATE)]


def test_an_input_that_was_a_nanosecond_before_a_set_may_still_join_it_and_one_that_passed_it_does_not():
    group = exact(inputs=2, required=(True, False), max_wait=9)
    before, after = (Message(1, START_NS + off, None) for off in (-1, 1))
    assert list(group.add(before, now=0)) == []
    assert list(group.add(Message(0, START_NS, "a"), now=0)) == []
    drop, match = group.add(after, now=0)
    assert drop == Drop(before, DropReason.TOO_FAR)
    assert match.messages == (Message(0, START_NS, "a"), None)


def test_of_three_that_fit_the_nearest_to_the_middle_is_taken_to_the_nanosecond():
    group = grouped(ApproximateTime(n_inputs=3, queue_size=9, slop_ns=20), required=(True, True, False), max_wait=0)
    for index, time in ((2, 1002), (2, 1003), (2, 1009), (0, 1000)):
        assert list(group.add(Message(index, time, None), now=0)) == []
    (match,) = group.add(Message(1, 1005, None), now=0)
    assert match.stamps == (1000, 1005, 1002)
    group.add(Message(0, 2000, None), now=0)
    *_, without = group.add(Message(1, 2001, None), now=0)
    assert without.stamps == (2000, 2001, None)


def test_an_input_that_fell_too_belongs_to_the_new_time_however_far_ahead_it_is():
    group = exact(queue=9)
    for index, column in ((0, 300), (1, 310), (0, 100)):
        group.add(Message(index, stamp(column), column), now=0)
    assert group.add(Message(1, stamp(205), 205), now=0) == []
    assert group.counts()[1].buffered == 1


def test_one_stamp_far_ahead_costs_no_more_than_what_was_buffered():
    group = exact()
    told = []
    for index, column in ((0, 10), (1, 10), (0, 90_000), (0, 12), (1, 12), (0, 14), (1, 14)):
        told += group.add(Message(index, stamp(column), column), now=0)
    assert [getattr(outcome, "reason", None) for outcome in told] == [None, DropReason.TIME_JUMP, None, None]


@pytest.mark.parametrize("offsets", [(0, 0), (-7, 0), (0, -7), (4, -7)])
@pytest.mark.parametrize(
    ("before", "column", "left_over"),
    [(90, 100, False), (90, 101, True), (150, 150, False), (150, 151, True), (150, 250, True), (150, 251, False)],
)
def test_left_over_is_what_goes_on_by_a_second_where_its_input_was_and_is_more_than_a_second_ahead(
    before, column, left_over, offsets
):
    offsets_ns = [offset * 1_000_000_000 for offset in offsets]
    group = exact(queue=9, offsets_ns=offsets_ns)
    for index, time in ((1, before), (0, 900), (0, 0), (1, column)):
        told = group.add(Message(index, stamp(time) - offsets_ns[index], time), now=0)
    assert [drop.reason.value for drop in told] == ["time_jump"] * left_over


def test_a_flush_forgets_where_each_input_was():
    group = exact()
    for index, column in ((0, 500), (1, 510)):
        group.add(Message(index, stamp(column), column), now=0)
    group.flush(DropReason.TIME_JUMP)
    for index, column in ((0, 100), (1, 520)):
        assert list(group.add(Message(index, stamp(column), column), now=0)) == []


def test_two_jumps_in_a_row_are_two():
    # Input 1 still has something of the first time when input 0 jumps once more.
    group = exact()
    told = []
    for index, column in ((1, 900), (0, 900), (0, 500), (0, 100), (1, 910), (1, 100)):
        told.append(list(group.add(Message(index, stamp(column), column), now=0)))
    assert [drop.reason.value for drop in told[4]] == ["time_jump"]
    assert [message.payload for message in told[5][0].messages] == [100, 100]


def test_any_input_may_be_the_first_to_begin_a_new_pass():
    group = exact()
    recording = [Message(index, stamp(column), column) for column in (0, 150, 300) for index in (0, 1)]
    for turn in range(4):
        first = turn % 2
        for message in sorted(recording, key=lambda message: (message.stamp, message.input != first)):
            group.add(message, now=0)
        assert group.sets == 3 * (turn + 1)


def test_stamps_below_zero_match_and_are_late_but_never_jump():
    group = exact()
    for time in (-9 * START_NS, -3 * START_NS):
        group.add(Message(0, time, None), now=0)
        assert [match.messages[0].stamp for match in group.add(Message(1, time, None), now=0)] == [time]
    late = Message(0, -4 * START_NS, None)
    assert list(group.add(late, now=0)) == [Drop(late, DropReason.LATE)]


def test_offsets_count_for_matching_and_messages_leave_with_the_stamps_they_came_with():
    group = exact(offsets_ns=(0, -12_000_000))
    first, second = Message(0, START_NS, "a"), Message(1, START_NS + 12_000_000, "A")
    assert group.add(first, now=0) == ()
    (match,) = group.add(second, now=0)
    assert match.messages == (first, second)


def test_offsets_count_for_what_comes_out_of_order():
    group = exact(offsets_ns=(0, -12_000_000))
    for index, time in ((0, START_NS), (1, START_NS + 99_000_000)):
        group.add(Message(index, time, None), now=0)
    (match,) = group.add(Message(1, START_NS + 12_000_000, None), now=0)
    assert [message.stamp for message in match.messages] == [START_NS, START_NS + 12_000_000]


def test_offsets_of_required_inputs_count_for_the_optional_ones():
    group = exact(3, required=(True, True, False), max_wait=0, offsets_ns=(-5, -5, 0))
    for index, time in ((2, START_NS), (0, START_NS + 5)):
        group.add(Message(index, time, None), now=0)
    (match,) = group.add(Message(1, START_NS + 5, None), now=0)
    assert [message.input for message in match.messages] == [0, 1, 2]


@pytest.mark.parametrize(
    ("restamp", "expected"), [(None, None), (Restamp.EARLIEST, 0), (Restamp.LATEST, 3), (1, 3), (0, 0)]
)
def test_restamp_gives_the_set_a_common_stamp(restamp, expected):
    group = approximate(slop=5, restamp=restamp, offsets_ns=(0, -3 * TICK_NS))
    group.add(Message(0, stamp(0), "a"), now=0)
    (match,) = group.add(Message(1, stamp(3), "A"), now=0)
    assert match.stamp == (None if expected is None else stamp(expected))


def test_restamp_by_a_missing_input_gives_the_earliest_stamp():
    group = approximate(3, required=(True, True, False), slop=5, restamp=2, max_wait=0)
    group.add(Message(0, stamp(2), "a"), now=0)
    (match,) = group.add(Message(1, stamp(2), "A"), now=0)
    assert (match.messages[2], match.stamp) == (None, stamp(2))


def test_counts_say_where_every_message_went():
    group = exact()
    for index, time in ((0, 1), (0, 2), (1, 2), (0, 3), (0, 1)):
        group.add(Message(index, time, None), now=0)
    drop = group.reject(Message(1, 0, None), DropReason.MALFORMED)
    assert drop == Drop(Message(1, 0, None), DropReason.MALFORMED)
    superseded_and_late = {DropReason.SUPERSEDED: 1, DropReason.LATE: 1}
    assert group.counts() == (
        InputCounts(fed=4, matched=1, dropped=superseded_and_late, buffered=1, needed_queue=None),
        InputCounts(fed=2, matched=1, dropped={DropReason.MALFORMED: 1}, buffered=0, needed_queue=None),
    )
    assert group.sets == 1


@pytest.mark.parametrize(
    "options", [{}, {"max_wait": 5}, {"inputs": 3, "required": (False, True, True), "max_wait": 5}]
)
def test_counts_tell_the_queue_that_was_needed(options):
    group = approximate(queue=5, slop=1, **options)
    for column in range(20):
        group.add(Message(1, stamp(column), None), now=0)
    if len(group.counts()) == 3:
        group.add(Message(2, stamp(7), None), now=0)
        assert [counts.needed_queue for counts in group.counts()] == [None, 14, None]
    else:
        group.add(Message(0, stamp(7), None), now=0)
        assert [counts.needed_queue for counts in group.counts()] == [None, 14]


def test_a_served_message_of_latest_time_is_matched_once_and_not_buffered():
    group = latest(max_wait=None)
    for index, column in ((1, 0), (0, 1), (0, 2)):
        group.add(Message(index, stamp(column), None), now=0)
    trigger, odom = group.counts()
    assert (trigger.matched, odom.matched, odom.buffered, group.sets) == (2, 1, 0, 2)


@pytest.mark.parametrize("column", [5, 6], ids=["while a set waits for the optional", "while a set is open"])
def test_a_flush_starts_afresh_but_counts_go_on(column):
    group = approximate(3, required=(True, True, False), max_wait=50)
    waiting = [Message(0, stamp(5), "a"), Message(1, stamp(column), "A"), Message(2, stamp(0), "x")]
    for message in waiting:
        group.add(message, now=0)
    assert group.next_deadline() == 50 * TICK_NS
    assert [counts.buffered for counts in group.counts()] == [1, 1, 1]
    by_input = sorted(group.flush(DropReason.SHUTDOWN), key=lambda drop: drop.message.input)
    assert by_input == [Drop(message, DropReason.SHUTDOWN) for message in waiting]
    assert group.next_deadline() is None
    assert [counts.dropped for counts in group.counts()] == [{DropReason.SHUTDOWN: 1}] * 3
    assert group.add(waiting[0], now=0) == [], "not late: what was before is forgotten"


@pytest.mark.parametrize("make", [partial(exact, inputs=3), partial(by_key, inputs=3)], ids=["stamp", "key"])
def test_a_flush_forgets_what_waits_for_optional_inputs_and_what_they_gave(make):
    group = make(required=(True, False, False), max_wait=50)
    first, second, third = (Message(index, stamp(column), None, key=index) for index, column in enumerate((5, 9, 9)))
    for message in (first, second):
        assert list(group.add(message, now=0)) == []
    assert [counts.buffered for counts in group.counts()] == [1, 1, 0]
    assert group.flush(DropReason.SHUTDOWN) == [Drop(message, DropReason.SHUTDOWN) for message in (first, second)]
    assert group.next_deadline() is None
    assert [counts.buffered for counts in group.counts()] == [0, 0, 0]
    for message in (third, first):
        assert list(group.add(message, now=0)) == [], "the second input has shown nothing yet"


def test_the_clock_may_fall_while_a_set_waits():
    group = approximate(max_wait=3)
    group.add(Message(0, stamp(0), "a"), now=100 * TICK_NS)
    group.add(Message(1, stamp(1), "A"), now=100 * TICK_NS)
    assert group.next_deadline() == 103 * TICK_NS
    assert list(group.expire(now=10 * TICK_NS)) == []
    assert group.next_deadline() == 13 * TICK_NS
    assert list(group.expire(now=13 * TICK_NS - 1)) == []
    (match,) = group.expire(now=13 * TICK_NS)
    assert [message.payload for message in match.messages] == ["a", "A"]


@pytest.mark.parametrize("make", [partial(exact, inputs=2), partial(by_key, inputs=2)], ids=["stamp", "key"])
def test_the_clock_may_fall_while_a_set_waits_for_an_optional_input(make):
    group = make(required=(True, False), max_wait=3)
    group.add(Message(0, stamp(0), "a", key=1), now=100 * TICK_NS)
    assert list(group.expire(now=99 * TICK_NS)) == []
    assert group.next_deadline() == 102 * TICK_NS
    (match,) = group.expire(now=102 * TICK_NS)
    assert match.messages[1] is None


def test_what_is_due_leaves_before_what_is_added():
    group = exact(inputs=2, required=(True, False), max_wait=3)
    group.add(Message(0, stamp(0), "a"), now=0)
    late, on_time = group.add(Message(0, stamp(9), "b"), now=3 * TICK_NS), group.next_deadline()
    assert [match.messages[0].payload for match in late] == ["a"]
    assert on_time == 6 * TICK_NS
    (match,) = group.add(Message(1, stamp(9), "B"), now=6 * TICK_NS)
    assert match.messages[1] is None, "B came too late for b"


@pytest.mark.parametrize("max_wait", [None, 3])
def test_no_message_is_needed_for_a_deadline(max_wait):
    group = approximate(max_wait=max_wait)
    assert group.next_deadline() is None
    assert list(group.expire(now=0)) == []


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"required": (True,)}, "must be 2, one required"),
        ({"required": (False, False), "max_wait": 1}, "must be 2, one required"),
        ({"required": (True, False)}, "needs max_wait_ns"),
        ({"offsets_ns": (0,)}, "must be 2"),
        ({"max_wait": -1}, "must be 0 or more"),
        ({"restamp": 2}, "must be one of 2 inputs"),
        ({"restamp": -1}, "must be one of 2 inputs"),
        ({"every": 0}, "must be 1 or more"),
        ({"min_set_period_ns": 0}, "must be 1 or more"),
    ],
)
def test_options_out_of_range_are_refused(wrong, told):
    with pytest.raises(ValueError, match=told):
        exact(**wrong)


def test_a_drawing_is_played_with_the_clock_of_its_columns():
    left, drawn = play_group(exact(), "left |a\nright |A\n-> A: aA")
    assert left == drawn
