"""Sets of any inputs, as users of Autoware's concatenation expect: lidars that die, return, come late or are lost."""

import random
from dataclasses import dataclass
from itertools import pairwise

import pytest

from syncrelay.sync import ApproximateTime, EqualKey, Match, Message, SyncGroup
from tests.faults.extent import chosen
from tests.sync.support.rigs import Tally

MS = 10**6
PERIOD, SLOP, MAX_WAIT, START = 100 * MS, 20 * MS, 60 * MS, 10**12
WORLDS = chosen(short=60, long=1_000)


def lidars(n_inputs=3, quorum=2, *, required=(), policy=None, tolerances=None, **options):
    made = policy or ApproximateTime(
        n_inputs=n_inputs,
        queue_size=10,
        slop_ns=SLOP,
        min_periods_ns=[PERIOD * 7 // 10] * n_inputs,
        tolerances_ns=tolerances,
    )
    return SyncGroup(
        made,
        required=[index in required for index in range(n_inputs)],
        quorum=quorum,
        max_wait_ns=MAX_WAIT,
        **options,
    )


@dataclass(frozen=True)
class Scan:
    """What one lidar sends of one turn: its payload is the number of the turn."""

    input: int
    turn: int
    stamp: int
    received: int


def played(group, sent):
    """The sets that leave and when, each deadline kept to the nanosecond."""
    left = []
    for scan in sorted(sent, key=lambda each: each.received):
        while (deadline := group.next_deadline()) is not None and deadline < scan.received:
            left += [(each, deadline) for each in group.expire(now=deadline)]
        message = Message(scan.input, scan.stamp, scan.turn)
        left += [(each, scan.received) for each in group.add(message, now=scan.received)]
    while (deadline := group.next_deadline()) is not None:
        left += [(each, deadline) for each in group.expire(now=deadline)]
    return left


def test_keys_need_a_required_input():
    with pytest.raises(ValueError, match="required"):
        lidars(policy=EqualKey(n_inputs=3, queue_size=10))


def half_of_slop(tolerances):
    """How far each input's stamps may be off."""
    return [SLOP // 2 if each is None else each for each in tolerances]


def drawn_world(rng):
    """Lidars that turn alike: stamps are as far off their turn's moment as they may; delays, losses, deaths, late ones.

    Some may be off by less than half of slop.
    """
    n_inputs = rng.choice((2, 3, 3, 4, 5))
    tolerances = rng.choice((None, [rng.choice((None, 0, 3 * MS, 7 * MS)) for _ in range(n_inputs)]))
    offs = half_of_slop(tolerances or [None] * n_inputs)
    slowest = rng.choice((10, 40, 150)) * MS
    loss = rng.choice((0, 0.05, 0.3))
    sent: list[Scan] = []
    last: dict[int, int] = {}
    for index in range(n_inputs):
        away = [(start, start + rng.randrange(1, 12)) for start in rng.sample(range(60), rng.choice((0, 1, 2)))]
        for turn in range(60):
            if any(begin <= turn < end for begin, end in away) or rng.random() < loss:
                continue
            stamp = START + turn * PERIOD + rng.randint(-offs[index], offs[index])
            # Of one lidar, messages come in order.
            last[index] = max(last.get(index, 0) + 1, stamp + rng.randrange(slowest))
            sent.append(Scan(index, turn, stamp, last[index]))
    return n_inputs, tolerances, sent


def test_in_any_world_each_turn_with_enough_lidars_in_time_is_one_whole_set():
    seen = {"sets": 0, "partial": 0, "late": 0}
    for seed in range(WORLDS):
        rng = random.Random(seed)
        n_inputs, tolerances, sent = drawn_world(rng)
        quorum = rng.randint(1, n_inputs)
        group, tally = lidars(n_inputs, quorum, tolerances=tolerances), Tally(n_inputs)
        left = played(group, sent)
        for scan in sent:
            tally.fed[scan.input] += 1
        for each, _ in left:
            tally.note(None, [each])
        sets = [(each, moment) for each, moment in left if isinstance(each, Match)]
        turns = [next(iter({m.payload for m in each.messages if m is not None})) for each, _ in sets]
        case = f"seed {seed}, {quorum} of {n_inputs}"
        assert all(len({m.payload for m in each.messages if m is not None}) == 1 for each, _ in sets), case
        assert all(one < other for one, other in pairwise(turns)), case
        assert tally.agrees(group), case
        by_turn = {turn: [scan for scan in sent if scan.turn == turn] for turn in range(60)}
        enough = {turn: sorted(each.received for each in came)[quorum - 1 :] for turn, came in by_turn.items()}
        dues = {turn: received[0] + MAX_WAIT for turn, received in enough.items() if received}
        for turn, came in by_turn.items():
            received = sorted(scan.received for scan in came)
            if len(came) < quorum:
                assert turn not in turns, case
                continue
            # A newer set that has waited long enough has the older ones leave.
            due = min(dues[later] for later in dues if later >= turn)
            seen["late"] += received[-1] > due
            if received[-1] > due or any(
                scan.received > due for each in by_turn.values() for scan in each if scan.turn < turn
            ):
                continue  # somebody came when this set, or an older one, had left
            assert turn in turns, case
            match, moment = sets[turns.index(turn)]
            assert {m.input for m in match.messages if m is not None} == {scan.input for scan in came}, case
            assert moment <= due, case
            seen["partial"] += len(came) < n_inputs
        seen["sets"] += len(sets)
    assert seen["sets"] > 20 * WORLDS, seen
    assert seen["partial"] > WORLDS, seen
    assert seen["late"] > WORLDS, seen
