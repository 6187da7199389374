"""Which sets there could be, and by which offset: of drawn moments, of which it is known what was made and what came.

At each moment each input makes a message, unless it is lost. It is stamped with some jitter and arrives after its lag.
"""

import random
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil
from typing import Any

import pytest

from syncrelay.config import GroupConfig
from syncrelay.explain.changes import Change, changed
from syncrelay.explain.dry_run import EngineDriver
from syncrelay.explain.possible_sets import possible_sets
from syncrelay.explain.received import as_arrays
from syncrelay.explain.trials import REQUIRED, Trials
from syncrelay.sync import DropReason, Match, Message, Outcome
from tests.explain.scenario import BEGAN, MS, Source, group_of
from tests.faults.extent import chosen


@dataclass(frozen=True)
class Moments:
    """Messages in the order of receipt; for each input the stamp by moment, offset added, of what was not lost."""

    config: GroupConfig
    offsets: Sequence[int]
    stamps: Sequence[dict[int, int]]
    messages: Sequence[Message]

    def places(self, index: int) -> dict[int, int]:
        """At which place, among all messages, each of one input arrived, by its stamp with offset."""
        return {
            each.stamp + self.offsets[index]: place for place, each in enumerate(self.messages) if each.input == index
        }

    def trials(self) -> Trials:
        inputs = as_arrays(self.messages, len(self.stamps))
        return Trials(self.config, inputs, is_window=False)


def drawn(
    chance: random.Random,
    policy: str,
    *,
    lost: float,
    jitter: float,
    ahead: Sequence[int] = (),
    count: int = 0,
    **keys: Any,
) -> Moments:
    n_inputs, period = len(ahead) or chance.choice([2, 3]), chance.choice([50, 100, 400]) * MS
    offsets = [chance.choice([0, 0, 1, -7]) * MS for _ in range(n_inputs)]
    lags = [chance.randint(1, 5) * MS + index + chance.choice([0, 0, 3 * period]) for index in range(n_inputs)]
    if ahead:
        lags = [2 * MS + index for index in range(n_inputs)]
    stamps: list[dict[int, int]] = [{} for _ in range(n_inputs)]
    came = []
    for moment in range(count or chance.randint(30, 60)):
        for index in range(n_inputs):
            if chance.random() >= lost:
                at = BEGAN + moment * period + chance.randint(0, round(jitter * period))
                stamps[index][moment] = at + (ahead[index] if ahead else 0)
                came.append(
                    (at + lags[index], Message(index, stamps[index][moment] - offsets[index], at + lags[index]))
                )
    options: dict[str, Any] = {"trigger": "/s0"} if policy == "latest_time" else {"slop": "5ms"}
    sources = [Source(f"/s{index}", 1, topic_options={"offset": f"{by}ns"}) for index, by in enumerate(offsets)]
    messages = [each for _, each in sorted(came, key=lambda each: each[0])]
    return Moments(group_of(sources, {"policy": policy, **options, **keys}), offsets, stamps, messages)


def partners(rig: Moments, pivot: int) -> list[list[int]]:
    """The sets there could be: all messages of a moment, or a trigger's and the latest of the others."""
    if rig.config.trigger is None:
        moments = sorted(set.intersection(*({*each} for each in rig.stamps)))
        return [[each[moment] for each in rig.stamps] for moment in moments]
    sets = []
    for stamp in rig.stamps[pivot].values():
        older = [[each for each in of.values() if each <= stamp] for of in rig.stamps]
        if all(older):
            sets.append([max(each) for each in older])
    return sets


def queue(rig: Moments, a_set: Sequence[int]) -> int:
    """How many messages of one input have arrived since its own, at most, when a set is known to be the best."""
    places = [rig.places(index) for index in range(len(a_set))]
    stamps = [sorted(each) for each in places]
    waits = int(rig.config.options.waits_for_next)
    last = [each[min(each.index(stamp) + waits, len(each) - 1)] for each, stamp in zip(stamps, a_set, strict=True)]
    complete = max(each[stamp] for each, stamp in zip(places, last, strict=True))
    held = ([at for at in each.values() if each[s] <= at <= complete] for each, s in zip(places, a_set, strict=True))
    return max(1, *map(len, held))


@pytest.mark.parametrize("policy", ["approximate_time", "approximate_time_eager", "latest_time"])
@pytest.mark.parametrize("jitter", [0.02, 0.0])
def test_the_possible_sets_are_those_of_the_moments_of_which_nothing_was_lost(policy, jitter):
    for seed in range(chosen(short=6, long=300)):
        chance = random.Random(f"{policy} {jitter} {seed}")
        rig = drawn(chance, policy, lost=chance.choice([0.0, 0.1]), jitter=jitter)
        is_window = chance.random() < 0.5
        n_inputs = len(rig.stamps)
        found = possible_sets(rig.config, as_arrays(rig.messages, n_inputs), range(n_inputs), is_window=is_window)
        assert found is not None
        assert rig.config.trigger in (None, found.pivot)
        assert rig.config.trigger is not None or len(rig.stamps[found.pivot]) == min(map(len, rig.stamps))
        sets = partners(rig, found.pivot)
        are_equal = not jitter and len(sets) >= 0.8 * len(rig.stamps[found.pivot])
        if is_window:
            begin, end = max(min(each.values()) for each in rig.stamps), min(max(e.values()) for e in rig.stamps)
            sets = [each for each in sets if begin <= each[found.pivot] <= end]
        assert found.stamps[:].tolist() == [each[found.pivot] - rig.offsets[found.pivot] for each in sets], seed
        assert found.spans[:].tolist() == [max(each) - min(each) for each in sets], seed
        assert found.queues[:].tolist() == [queue(rig, each) for each in sets], seed
        assert found.is_exact is (are_equal and rig.config.trigger is None)


def test_the_offset_that_is_found_is_by_how_much_one_clock_was_ahead():
    for seed in range(chosen(short=40, long=2000)):
        chance = random.Random(f"offset {seed}")
        n_inputs, odd = chance.choice([(2, 0), (2, 1), (3, 0), (3, 1), (3, 2)])
        by = chance.choice([-1, 1]) * chance.randint(8, 900)
        rig = drawn(
            chance,
            "approximate_time",
            lost=0,
            jitter=0.001,
            ahead=[by * MS if index == odd else 0 for index in range(n_inputs)],
        )
        own = rig.offsets[odd]
        trials = rig.trials()
        told = f"seed {seed}: {odd} of {n_inputs} by {by} ms"
        first = sorted(rig.stamps[0].values())
        period = (first[-1] - first[0]) / (len(first) - 1) / MS
        near = abs(by - round(by / period) * period)
        assert trials.apart(odd) == pytest.approx(-by * MS, abs=MS), told
        clock = trials.clock_offset(odd)
        assert clock is not None, told
        assert clock == Change("offset", clock.value, odd), told
        assert clock.parsed == pytest.approx(own - by * MS, abs=MS), told
        if near < 8 or period / 2 - near < 2:
            # What lies whole periods off looks as if nothing did, and what lies amid two has no nearest.
            continue
        offsets = {*trials.offsets()}
        if near > 0.38 * period and not offsets:
            # The nearest is hardly nearer than the next.
            continue
        assert {each.input for each in offsets} == {odd}, told
        assert all(each.parsed == pytest.approx(own - by * MS, abs=MS) for each in offsets), told
        assert trials.pairs_neighbours is (abs(by) > period / 2), told
        moved = trials.by_offset(next(iter(offsets)))
        assert moved is not None, told
        assert moved.given >= moved.possible - 1 >= len(first) - 2, told


@pytest.mark.parametrize("policy", ["approximate_time", "approximate_time_eager"])
def test_a_verdict_counts_what_a_longer_queue_gives_of_the_sets_within_slop(policy):
    for seed in range(chosen(short=12, long=500)):
        chance = random.Random(f"verdict {seed}")
        slop = chance.randint(1, 8)
        rig = drawn(
            chance, policy, lost=0, jitter=0.02, slop=f"{slop}ms", queue_size=2, count=chance.choice([8, 9, 10, 40])
        )
        trials = rig.trials()
        sets = [tuple(each) for each in partners(rig, 0)]
        possible = [each for each in sets if max(each) - min(each) <= slop * MS]
        assert (trials.given(()), len(trials.spans())) == (left(rig, rig.config, sets), len(sets)), seed
        found = trials.verdict(REQUIRED, {"queue_size", "policy"} if policy == "approximate_time" else {"queue_size"})
        now = left(rig, rig.config, possible)
        is_enough = now >= len(possible) - 1
        is_certain = len(rig.stamps[0]) >= 10 and (len(possible) < 5 or is_enough)
        assert found.may_miss is not is_certain, seed
        if is_enough or len(possible) < 5:
            assert found.tried == (), seed
        for each in found.tried:
            (change,) = each.changes
            assert (each.possible, each.now) == (len(possible), now), seed
            assert each.given == left(rig, changed(rig.config, each.changes), possible) >= len(possible) - 1, seed
            assert (change.key, change.input) == ("queue_size", None), seed
            # A quarter more than is needed, and one.
            assert change.parsed == ceil(1.25 * max(queue(rig, each) for each in sets)) + 1, seed


@pytest.mark.parametrize("max_wait_ms", [0, 250])
@pytest.mark.parametrize("millis", [2000, 2040])
def test_a_run_of_a_group_at_ticks_ends_with_the_ticks_of_its_last_messages(max_wait_ms, millis):
    keys = {"policy": "latest_time", "trigger": "10 Hz"} | ({"max_wait": f"{max_wait_ms}ms"} if max_wait_ms else {})
    config = group_of([Source("/a", 1), Source("/b", 1)], keys)
    times = range(BEGAN, BEGAN + millis * MS + 1, 10 * MS)
    sets: list[int] = []
    driver = EngineDriver(config, lambda left, now: sets.extend(now for each in left if isinstance(each, Match)))
    driver.run(Message(index, at, at) for at in times for index in (0, 1))
    assert sets[-1] == BEGAN + (2000 + max_wait_ms) * MS
    assert {two - one for one, two in pairwise(sets)} == {100 * MS}


def left(rig: Moments, config: GroupConfig, among: Sequence[tuple[int, ...]]) -> int:
    """How many of some sets an engine gives."""
    engine, given = config.engine(), list[Outcome]()
    for each in rig.messages:
        given += engine.add(each, now=each.payload)
    given += engine.flush(DropReason.SHUTDOWN)
    shifted = [
        tuple((stamp or 0) + offset for stamp, offset in zip(each.stamps, rig.offsets, strict=True))
        for each in given
        if isinstance(each, Match)
    ]
    return sum(each in among for each in shifted)
