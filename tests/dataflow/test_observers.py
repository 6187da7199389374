"""What the relay observes of itself, evaluation by evaluation, on made-up figures."""

import random
import time

import pytest

from syncrelay.dataflow.observers import Discovery, Losses, SimulatedClock, Standstills, SystemClock, Waits
from syncrelay.explain import ClockState, Standstill, Step
from syncrelay.runtime import SystemRuntime

_SECOND = 1_000_000_000


def test_the_longest_standstill_is_told_for_ten_evaluations():
    standstills = Standstills()
    for until, ns in (100, 3), (200, 7), (300, 5):
        standstills.note(Standstill(until, ns))
    assert standstills.recent == ()
    standstills.observe()
    for _ in range(9):
        assert list(standstills.recent) == [Standstill(200, 7)]
        standstills.observe()
    assert list(standstills.recent) == [Standstill(200, 7)]
    standstills.observe()
    assert standstills.recent == ()


def test_a_step_stands_still_for_longer_than_it_rested_on_purpose():
    standstills = Standstills()
    standstills.end(rest=_SECOND)
    standstills.observe()
    standstills.end()
    standstills.observe()
    rested, worked = standstills.recent
    assert (rested.rested, worked.rested) == (_SECOND, 0)
    assert rested.ns + _SECOND >= 0
    assert rested.ns < worked.ns


def test_the_longest_wait_is_told_for_ten_evaluations():
    waits = Waits()
    assert waits.longest == 0
    for waited in (2, 9, *[1] * 9):
        waits.observe(waited)
    assert waits.longest == 9
    waits.observe(1)
    assert waits.longest == 1


# Evaluations after which a publisher that was found has found the subscription, too.
_SETTLED = [(0, "a")] * 5


@pytest.mark.parametrize(
    ("totals_and_publishers", "recent", "in_all"),
    [
        pytest.param([*_SETTLED, (4, "a"), *[(5, "a")] * 2], 5, 5, id="what is lost of a known publisher counts"),
        pytest.param([(8, "a")] * 8, 0, 0, id="what a first publisher sent before counts not"),
        pytest.param([*_SETTLED[1:], (4, "a"), *[(5, "a")] * 2], 1, 1, id="nor what it sends before five evaluations"),
        pytest.param([*_SETTLED, (6, "ab"), (7, "ab")], 0, 0, id="nor what a second one sent before"),
        pytest.param([*_SETTLED, (6, "b"), (7, "b")], 0, 0, id="nor what one sent that took its place"),
        pytest.param([*_SETTLED, (6, "a"), *[(6, "ab")] * 9], 0, 0, id="nor what is counted before the graph shows it"),
        pytest.param(
            [*_SETTLED, (3, "a"), *[(1, "a")] * 6, *[(2, "a")] * 2], 1, 4, id="a new subscription begins at 0"
        ),
        pytest.param([*_SETTLED, *[(3, "a")] * 12], 0, 3, id="after ten evaluations it counts in all only"),
    ],
)
def test_only_what_a_known_publisher_lost_of_late_is_a_loss(totals_and_publishers, recent, in_all):
    losses = Losses()
    assert losses.recent == 0
    for total, publishers in totals_and_publishers:
        losses.observe(total, links=frozenset(publishers))
    assert (losses.recent, losses.total) == (recent, in_all)


_MS = 1_000_000


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("step", "has_stepped", "is_told"),
    [(100 * _MS, False, False), (100 * _MS + 1, True, False), (500 * _MS - 1, True, False), (500 * _MS, True, True)],
)
def test_a_clock_that_was_set_has_stepped_once_and_is_told_for_half_a_minute(step, has_stepped, is_told, sign):
    runtime, ahead = SystemRuntime(), [0]
    runtime.monotonic_ns = lambda: _SECOND
    runtime.time_ns = lambda: _SECOND + ahead[0]
    clock = SystemClock(runtime=runtime)
    assert not clock.has_stepped(0)
    for at in (10 * _SECOND, 20 * _SECOND):
        ahead[0] += sign * step
        assert [clock.has_stepped(at), clock.has_stepped(at)] == [has_stepped, False]
        assert (
            clock.last_step(at)
            == clock.last_step(at + 30 * _SECOND - 1)
            == (Step(at, sign * step) if is_told else None)
        )
        assert clock.last_step(at + 30 * _SECOND) is None


def test_simulated_time_stands_still_when_it_did_not_move_for_two_and_a_half_ticks_at_1_hz():
    clock = SimulatedClock()
    now = time.time_ns()
    seen = []
    for simulated, passed in ((7, 0), (7, 2500 * _MS - 1), (7, 2500 * _MS), (8, 4 * _SECOND)):
        clock.observe(simulated, now=now + passed)
        seen.append(clock.state)
    assert seen == [ClockState(received=True, stopped=ns) for ns in (None, None, 2500 * _MS, None)]


def test_a_simulated_clock_that_nobody_tells_was_never_received():
    clock = SimulatedClock()
    clock.observe(0, now=time.time_ns() + 7 * _SECOND)
    assert not clock.state.received
    assert clock.state.stopped == pytest.approx(7 * _SECOND, rel=0.1)


@pytest.mark.parametrize("rate", [0.5, 1.0, 10.0])
def test_simulated_time_is_known_for_the_messages_between_two_evaluations(rate):
    clock = SimulatedClock()
    for second in (1, 2, 3):
        clock.observe(round(second * rate * _SECOND), now=second * _SECOND)
    assert clock.is_steady
    assert clock.at(2_500_000_000) == round(2.5 * rate * _SECOND)


@pytest.mark.parametrize(("before", "after", "passed"), [(0, 5, 1), (5, 4, 1), (5, 6, 0)])
def test_a_simulated_clock_that_began_or_was_set_back_tells_nothing_of_the_time_before(before, after, passed):
    clock = SimulatedClock()
    clock.observe(before * _SECOND, now=_SECOND)
    clock.observe(after * _SECOND, now=(1 + passed) * _SECOND)
    assert not clock.is_steady
    assert clock.at(0) == (after - 1 - passed) * _SECOND


# Fast DDS's: every node announces itself so often, and is known some tenths of a second after it was heard.
_ANNOUNCED_S = 3.0
_DISCOVERIES = 500


@pytest.mark.parametrize("seed", [28])
def test_discovery_goes_on_until_all_nodes_are_found_and_no_longer_than_it_must(seed):
    """Nodes that run when this one joins at 0 s: each is heard at once, or misses that and is heard at its next."""
    chance, late = random.Random(seed), 0
    for number in range(_DISCOVERIES):
        heard = [chance.choice([0.0, chance.uniform(0, _ANNOUNCED_S)]) for _ in range(chance.randrange(12))]
        found = [at + chance.uniform(0.01, 0.5) for at in heard]
        late += any(at > 2 for at in found)
        discovery, at, known = Discovery(now=0.0), 0.0, 0.0
        while discovery.goes_on(at):
            discovery.observe(frozenset(each for each in found if each <= at), now=at)
            known, at = at, at + chance.uniform(0.9, 1.4)
        case = f"{number} of seed {seed}: found at {found}"
        assert all(each <= at for each in found), case
        # A look that comes late is the first to see what came before it.
        assert known <= max(found, default=0.0) + 1.4 + 4.0, case
    assert late > _DISCOVERIES / 4


def test_discovery_ends_in_a_graph_that_never_rests():
    discovery, at = Discovery(now=0.0), 0.0
    while discovery.goes_on(at):
        discovery.observe(at, now=at)
        at += 1
    assert at == 10


def test_discovery_that_is_over_does_not_begin_again():
    discovery = Discovery(now=0.0)
    discovery.observe("a graph", now=1.0)
    assert not discovery.goes_on(5.0)
    discovery.observe("another graph", now=5.0)
    assert not discovery.goes_on(5.0)
