"""Sets with and without optional inputs, drawn; what a flush or a falling clock does while one waits for them."""

from functools import partial

import pytest

from syncrelay.sync import (
    ApproximateEpsilonTime,
    ApproximateTime,
    Drop,
    DropReason,
    LatestTime,
    Message,
)
from tests.sync.support.grouped import approximate, by_key, eager, exact, grouped, paced, third_optional
from tests.sync.support.timeline import START_NS, TICK_NS, group_cases, stamp

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
                LatestTime(n_inputs=3, queue_size=9, trigger=0, max_ages_ns=[2 * TICK_NS] * 3),
                required=(True, True, False),
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


@pytest.mark.parametrize("make", [partial(exact, inputs=2), partial(by_key, inputs=2)], ids=["stamp", "key"])
def test_the_clock_may_fall_while_a_set_waits_for_an_optional_input(make):
    group = make(required=(True, False), max_wait=3)
    group.add(Message(0, stamp(0), "a", key=1), now=100 * TICK_NS)
    assert list(group.expire(now=99 * TICK_NS)) == []
    assert group.next_deadline() == 102 * TICK_NS
    (match,) = group.expire(now=102 * TICK_NS)
    assert match.messages[1] is None
