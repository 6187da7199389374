from dataclasses import replace
from itertools import accumulate

import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.sync import Drop, DropReason, LatestAtTicks, Match, Message, SyncGroup, Ticks
from syncrelay.sync.latest_at_ticks import REST_NS
from tests.sync.support.rigs import START, TICK, Step, options, run, steps, take
from tests.sync.support.timeline import START_NS, TICK_NS


def by_clock(queue=10, hz=20, **options):
    return grouped(LatestAtTicks(n_inputs=2, queue_size=queue, ticks=Ticks(hz), max_ages_ns=[None] * 2), **options)


def grouped(policy, *, max_wait=None, **options):
    return SyncGroup(policy, max_wait_ns=None if max_wait is None else max_wait * TICK_NS, **options)


def at(ms):
    return START_NS + ms * 1_000_000


def message(index, ms):
    return Message(index, at(ms), None)


def sets_of(outcomes):
    return [outcome for outcome in outcomes if isinstance(outcome, Match)]


@pytest.mark.parametrize(
    ("ticks", "index", "expected"),
    [
        (Ticks(30), 1, 33_333_333),
        (Ticks(30), 3, 100_000_000),
        (Ticks(2997, 100), 2997, 100_000_000_000),
        (Ticks(1, 10), 1, 10_000_000_000),
        (Ticks(10_000), 17_000_000_000_001, 1_700_000_000_000_100_000),
    ],
)
def test_ticks_are_whole_nanoseconds_that_do_not_drift(ticks, index, expected):
    assert ticks.at(index) == expected
    assert [str(ticks) for ticks in (Ticks(30), Ticks(2997, 100))] == ["30 Hz", "29.97 Hz"]


@given(
    numerator=st.integers(1, 10**10),
    denominator=st.integers(1, 10**9),
    time=st.integers(-(10**18), 4 * 10**18),
)
def test_every_time_lies_between_two_ticks_and_a_period_is_rounded_up(numerator, denominator, time):
    ticks = Ticks(min(numerator, 10_000 * denominator), denominator)
    last = ticks.last_until(time)
    assert ticks.at(last) <= time < ticks.at(last + 1)
    first = ticks.first_from(time)
    assert ticks.at(first - 1) < time <= ticks.at(first)
    assert 0 <= ticks.period_ns * ticks.numerator - ticks.at(ticks.numerator) < ticks.numerator
    assert ticks.hz * ticks.period_ns == pytest.approx(10**9, rel=1e-5)


def test_an_hour_in_which_nothing_came_costs_no_work_and_gives_no_more_sets_than_its_first_seconds():
    group = by_clock(hz=1000, queue=10)
    for index in range(2):
        group.add(message(index, 0), now=at(0))
    hour = 3_600_000
    left = sets_of(group.expire(now=at(hour)))
    assert len(left) == REST_NS // 1_000_000
    assert group.next_deadline() is None
    group.add(message(0, hour), now=at(hour))
    assert group.next_deadline() == at(hour + 1)
    (match,) = group.expire(now=at(hour + 1))
    assert match.stamps == (at(hour), at(0))


def test_no_tick_comes_twice_when_the_clock_is_corrected_and_all_come_again_when_it_starts_again():
    group = by_clock()
    for index in range(2):
        group.add(message(index, 0), now=at(0))
    assert [match.tick for match in group.expire(now=at(2000))] == [at(50 * n) for n in range(1, 41)]
    assert group.expire(now=at(1000)) == []
    assert group.next_deadline() == at(2050)
    # A reset simulation, which also flushes.
    group.flush(DropReason.TIME_JUMP)
    for index in range(2):
        group.add(message(index, 10), now=at(20))
    assert [match.tick for match in group.expire(now=at(100))] == [at(50), at(100)]
    group.pass_over(now=at(-1500))
    assert group.next_deadline() == at(50)


def test_the_queue_that_is_needed_has_room_for_every_tick_that_is_waited_for():
    def overflowed(queue):
        group = by_clock(queue=queue, max_wait=50)
        left = []
        for ms in range(0, 2000, 10):
            for index in range(2):
                left += group.add(message(index, ms), now=at(ms))
        return group.counts()[0].needed_queue, len(sets_of(left))

    assert overflowed(4) == (12, 0)
    needed, sets = overflowed(12)
    assert needed is None
    assert sets == 30


_RATES = (Ticks(100), Ticks(20), Ticks(30), Ticks(2997, 100), Ticks(300), Ticks(3, 2))


def clocked(chosen, ticks, queue):
    policy = LatestAtTicks(n_inputs=chosen.n_inputs, queue_size=queue, ticks=ticks, max_ages_ns=chosen.max_ages_ns)
    return grouped(
        policy,
        required=chosen.required,
        max_wait=chosen.max_wait,
        offsets_ns=[offset * TICK for offset in chosen.offsets] or None,
    )


def slow_sets(chosen, ticks, taken):
    """The rule itself: at each tick, of what was added before it, the latest not newer one of every input."""
    wait = (chosen.max_wait or 0) * TICK
    offsets = [offset * TICK for offset in chosen.offsets or (0,) * chosen.n_inputs]
    for index in range(ticks.last_until(taken[0].now - wait) + 1, ticks.last_until(taken[-1].now - wait) + 1):
        tick = ticks.at(index)
        came = [step.message for step in taken if step.message is not None and step.now < tick + wait]
        members = []
        for place, (offset, max_age) in enumerate(zip(offsets, chosen.max_ages_ns, strict=True)):
            ages = [tick - each.stamp - offset for each in came if each.input == place]
            age = min((age for age in ages if age >= 0), default=None)
            members.append(None if age is None or (max_age is not None and age > max_age) else tick - age - offset)
        if all(stamp is not None for stamp, needed in zip(members, chosen.required, strict=True) if needed):
            yield tick, tuple(members)


@given(chosen=options(thinned=False), ticks=st.sampled_from(_RATES), data=st.data())
def test_with_the_queue_that_is_needed_sets_are_those_of_the_rule(chosen, ticks, data):
    taken = [
        step for step in data.draw(steps(chosen.n_inputs, jumps=False)) if step.message is None or step.message.stamp
    ]
    clocks = accumulate((step.now for step in taken), max)
    taken = [replace(step, now=clock) for step, clock in zip(taken, clocks, strict=True)]
    short = clocked(chosen, ticks, queue=chosen.queue_size)
    for step in taken:
        for drop in take(short, step):
            if isinstance(drop, Drop) and drop.reason is DropReason.OVERFLOW:
                assert short.counts()[drop.message.input].buffered == chosen.queue_size
    needed = max(each.needed_queue or chosen.queue_size for each in short.counts())
    if taken:
        left = sets_of(outcome for outcomes in run(clocked(chosen, ticks, queue=needed), taken) for outcome in outcomes)
        assert [(match.tick, match.stamps) for match in left] == list(slow_sets(chosen, ticks, taken))


@given(chosen=options(thinned=False), ticks=st.sampled_from(_RATES), data=st.data())
def test_the_next_deadline_is_when_the_next_set_leaves(chosen, ticks, data):
    group = clocked(chosen, ticks, queue=chosen.queue_size)
    clock = START
    for step in data.draw(steps(chosen.n_inputs)):
        clock = max(clock, step.now)
        take(group, Step(clock, step.message))
    deadline = group.next_deadline()
    if deadline is not None:
        assert deadline > clock
        assert list(group.expire(now=deadline - 1)) == []
        (match,) = sets_of(group.expire(now=deadline))
        assert match.tick + (chosen.max_wait or 0) * TICK == deadline
