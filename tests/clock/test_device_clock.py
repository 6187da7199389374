"""Stamps of a device are mapped to the host's time: as near as its jitter allows, whatever its clock does."""

import random
from statistics import fmean

import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.clock import UNREADABLE, DeviceClock, Step, host_times
from tests.clock import peers
from tests.clock.traces import SECOND, Trace, rig, trace
from tests.faults.extent import chosen

TRACES = chosen(short=2, long=200)
RIGS = chosen(short=12, long=10_000)
SEED = chosen(short=1, long=random.randrange(10**9))
NOW = 1_700_000_000 * SECOND


def right(drawn: Trace, errors: list[float]) -> float:
    """The share of mapped stamps that are as near as they should be."""
    return sum(error <= drawn.tolerance for error in errors) / len(errors)


@pytest.mark.hypothesis
def test_95_in_100_stamps_are_mapped_within_half_a_millisecond_or_a_tenth_of_the_jitter():
    drawn = [trace(f"{SEED} {number}") for number in range(TRACES)]
    shares = [right(each, each.errors(DeviceClock().host_time)) for each in drawn]
    assert fmean(shares) >= 0.95, (SEED, shares)
    for peer in (peers.averaging, peers.theil_sen, peers.convex_hull):
        assert fmean(right(each, each.errors(peer())) for each in drawn) < fmean(shares), (SEED, peer)


@pytest.mark.hypothesis
def test_no_rig_is_worse_off_than_with_times_of_receipt():
    for number in range(RIGS):
        drawn = rig(f"{SEED} {number}")
        every = Trace([each._replace(is_known=True) for each in drawn.samples], drawn.jitter_s)
        mapped, received = every.errors(DeviceClock().host_time), every.errors(lambda _stamp, received: received)
        assert sum(mapped) <= sum(received), (SEED, number)


@pytest.mark.parametrize("number", range(2))
def test_mapped_times_rise_and_nothing_is_received_before_its_time(number):
    clock, before = DeviceClock(), (0, 0)
    for sample in trace(f"{SEED} order {number}", seconds=150).samples:
        host = clock.host_time(sample.stamp, sample.received)
        assert host <= max(sample.received, before[1] + 1), SEED
        if sample.stamp > before[0]:
            assert host > before[1], SEED
        elif sample.stamp == before[0]:
            assert host == before[1], SEED
        before = sample.stamp, host


@pytest.mark.parametrize("by", [-7200, -3.5, 0.25, 3600])
def test_a_clock_that_is_set_is_noticed_and_its_rate_is_kept(by):
    chance = random.Random(SEED)
    steps: list[Step] = []
    clock = DeviceClock(stepped=steps.append)
    for number in range(2400):
        at, off = number / 20, by if number >= 1200 else 0
        stamp = NOW + round((at * (1 - 100e-6) + off) * SECOND)
        host = clock.host_time(stamp, NOW + round((at + chance.expovariate(500)) * SECOND))
        # After the first 20 s, its rate is known for good.
        if number > 400 and not 1200 <= number < 1300:
            assert abs(host - NOW - at * SECOND) < SECOND // 1000
    (step,) = steps
    assert step.by == pytest.approx(by * SECOND, abs=0.02 * SECOND)
    assert 0 <= step.at - NOW - 60 * SECOND < SECOND


def test_a_clock_that_was_left_alone_was_never_set_however_late_its_messages_come():
    for number in range(6):
        drawn = trace(f"{SEED} alone {number}", seconds=120, settings=0, has_outage=False)
        steps: list[Step] = []
        clock = DeviceClock(stepped=steps.append)
        for sample in drawn.samples:
            clock.host_time(sample.stamp, sample.received)
        assert all(abs(step.by) < max(1.6 * SECOND, 20 * drawn.jitter_s * SECOND) for step in steps), SEED


def test_a_known_least_delay_is_taken_off():
    plain, known = DeviceClock(), DeviceClock(delay_ns=8_000_000)
    for number in range(100):
        stamp, received = number * SECOND, NOW + number * SECOND + number % 7
        assert known.host_time(stamp, received) == plain.host_time(stamp, received) - (8_000_000 if stamp else 0)


def test_a_stamp_that_was_never_set_stays_so():
    clock = DeviceClock()
    assert clock.host_time(0, NOW) == 0
    assert clock.host_time(SECOND, NOW) == NOW
    assert clock.host_time(0, NOW + SECOND) == 0
    assert clock.host_time(2 * SECOND, NOW + SECOND) == NOW + SECOND


@pytest.mark.parametrize("away_s", [90, 110, 700, 1600, 90_000])
def test_a_device_that_was_away_is_mapped_on(away_s):
    clock = DeviceClock()
    for number in range(1200):
        now = NOW + number * SECOND // 20 + (away_s * SECOND if number >= 600 else 0)
        host = clock.host_time(now - 5 * SECOND, now + number % 7 * 100_000)
        assert abs(host - now) < SECOND // 1000


@pytest.mark.parametrize("number", range(3))
def test_a_stamp_now_and_then_that_is_late_moves_no_other(number):
    chance, clock, mapped = random.Random(f"{SEED} late {number}"), DeviceClock(), []
    for at in (each / 30 for each in range(3000)):
        late = chance.uniform(0.5e-3, 2e-3) if chance.random() < 0.002 else 0
        stamp = NOW + round((at * (1 + 50e-6) + late) * SECOND)
        host = clock.host_time(stamp, NOW + round((at + 0.02 + chance.expovariate(1000)) * SECOND))
        if at > 30 and not late:
            mapped.append(abs(host - NOW - (at + 0.02) * SECOND) < SECOND // 2000)
    assert fmean(mapped) > 0.95, SEED


@pytest.mark.parametrize("by_s", [-3600, -2, 2, 3600])
def test_time_goes_on_where_this_machine_s_clock_is_set(by_s):
    clock = DeviceClock()
    for number in range(400):
        now = NOW + (number * SECOND) // 20 + (by_s * SECOND if number >= 200 else 0)
        host = clock.host_time(7 * SECOND + number * SECOND // 20, now + number % 7 * 100_000)
        if not 200 <= number < 220:
            assert abs(host - now) < SECOND // 1000


@given(
    st.lists(st.tuples(st.integers(-(2**31) * SECOND, 2**32 * SECOND), st.integers(0, 2**63 - 1)), max_size=60),
    st.integers(0, 10**10),
    st.booleans(),
)
def test_whatever_is_stamped_and_received_is_mapped_to_a_time(arrivals, delay, are_in_order):
    """A recording may hold any numbers."""
    clock = DeviceClock(delay_ns=delay)
    for stamp, received in sorted(arrivals, key=lambda each: each[1]) if are_in_order else arrivals:
        host = clock.host_time(stamp, received)
        assert -(2**63) < host < 2**63
        assert stamp or host == 0


def test_many_stamps_are_mapped_as_they_are_one_by_one_and_those_that_are_none_stay():
    pairs = [(300 * SECOND + n * 100_000_000, NOW + n * 100_000_000 + (n * 7919 % 13) * 1_000_000) for n in range(80)]
    pairs[20] = 0, pairs[20][1]
    clock, of_all = DeviceClock(), DeviceClock()
    one_by_one = [clock.host_time(*each) for each in pairs]
    pairs.insert(40, (UNREADABLE, pairs[39][1]))
    one_by_one.insert(40, UNREADABLE)
    assert [*host_times(of_all, *zip(*pairs, strict=True))] == one_by_one
    assert one_by_one[20] == 0
