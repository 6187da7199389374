"""Engines of equal state have equal futures, and whatever may make futures differ makes states differ."""

import pickle
from collections import deque
from types import MethodType
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.config.policies import GROUP_MODELS
from syncrelay.sync import DropReason, Message
from syncrelay.sync.messages import Match
from syncrelay.sync.state import state_of
from tests.sync.support.rigs import (
    BY_CLOCK,
    POLICIES,
    START,
    TICK,
    Options,
    Step,
    make_group,
    options,
    steps,
    take,
)

every_policy = pytest.mark.parametrize("policy", [*POLICIES, *BY_CLOCK])


def name(payload):
    return payload


def state(group):
    return group.state(name)


def counted(group):
    """The counts, but for what is told of queues that were too short."""
    return [(each.fed, each.matched, dict(each.dropped), each.buffered) for each in group.counts()]


def since(group, before):
    """What was counted since; what leaves now may have been fed before."""
    return [
        (fed - old_fed, matched - old_matched, {key: value - old.get(key, 0) for key, value in new.items()}, buffered)
        for (fed, matched, new, buffered), (old_fed, old_matched, old, _) in zip(counted(group), before, strict=True)
    ]


def without_zeros(counts):
    return [
        (fed, matched, {key: value for key, value in drops.items() if value}, held)
        for fed, matched, drops, held in counts
    ]


def follow(whole, late, taken):
    """Feed both; from the first equal state on, all that they give and count has to be equal. Return where it was."""
    equal_from = None
    before = None
    for place, step in enumerate(taken):
        if equal_from is None and state(whole) == state(late):
            equal_from, before = place, (counted(whole), counted(late))
        left = list(take(whole, step)), list(take(late, step))
        if equal_from is not None:
            assert before is not None
            assert left[0] == left[1]
            assert whole.next_deadline() == late.next_deadline()
            assert state(whole) == state(late)
            assert without_zeros(since(whole, before[0])) == without_zeros(since(late, before[1]))
    if equal_from is not None:
        assert whole.flush(DropReason.SHUTDOWN) == late.flush(DropReason.SHUTDOWN)
    return equal_from


def test_every_policy_of_a_file_is_among_those_tested():
    names = {get_args(model.model_fields["policy"].annotation)[0] for model in GROUP_MODELS}
    assert names == set(POLICIES)


@every_policy
@given(data=st.data())
def test_engines_of_equal_state_give_and_count_the_same_from_then_on(policy, data):
    chosen = data.draw(options())
    taken = data.draw(steps(chosen.n_inputs)) + data.draw(steps(chosen.n_inputs))
    whole, late = make_group(policy, chosen), make_group(policy, chosen)
    begin = data.draw(st.integers(0, len(taken)))
    for step in taken[:begin]:
        take(whole, step)
    follow(whole, late, taken[begin:])


def regular(count):
    """Two inputs at one pace, the second a tick behind; each pair has a key of its own."""
    times = [(pair * 10 + index, index, pair) for pair in range(count) for index in range(2)]
    return [
        Step(START + time * TICK, Message(index, START + time * TICK, time, key=pair)) for time, index, pair in times
    ]


def aligned(count):
    """The same, but the stamps of a pair are equal."""
    return [
        Step(step.now, Message(step.message.input, START + step.message.key * 10 * TICK, *_rest(step.message)))
        for step in regular(count)
    ]


def _rest(message):
    return message.payload, message.key


def pairs_for(policy):
    return aligned if policy in ("exact_time", "latest_time") else regular


@every_policy
@pytest.mark.parametrize("max_wait", [None, 3])
@pytest.mark.parametrize("begin", [10, 11])
def test_an_engine_that_starts_late_has_the_state_of_the_whole_after_some_sets(policy, max_wait, begin):
    taken = pairs_for(policy)(20)
    chosen = Options(required=(True, True), max_wait=max_wait)
    whole, late = make_group(policy, chosen), make_group(policy, chosen)
    for step in taken[:begin]:
        take(whole, step)
    assert state(whole) != state(late)
    equal_from = follow(whole, late, taken[begin:])
    assert equal_from is not None
    assert equal_from <= 8


@pytest.mark.parametrize("policy", POLICIES)
def test_the_phase_of_thinning_is_state(policy):
    taken = pairs_for(policy)(20)
    chosen = Options(required=(True, True), every=2)
    starts = {}
    for begin in (0, 2, 4):
        starts[begin] = make_group(policy, chosen)
        for step in taken[begin:]:
            take(starts[begin], step)
    assert state(starts[0]) == state(starts[4]) != state(starts[2])


@every_policy
@given(data=st.data())
def test_a_pickled_engine_goes_on_where_it_was(policy, data):
    chosen = data.draw(options())
    taken, after = data.draw(steps(chosen.n_inputs)), data.draw(steps(chosen.n_inputs))
    group = make_group(policy, chosen)
    for step in taken:
        take(group, step)
    copy = pickle.loads(pickle.dumps(group))  # noqa: S301  made here
    assert state(copy) == state(group)
    assert follow(group, copy, after) in (0, None)


# What influences no set and no count: how long queues should have been, what was counted; and what a candidate was.
_ASIDE = {
    ("Losses", "_lost"),
    ("Losses", "needed"),
    ("LatestAtTicks", "_needed"),
    ("Ledger", "fed"),
    ("Ledger", "sets"),
    ("Ledger", "_absent"),
    ("Ledger", "_dropped"),
    ("EqualKey", "_fed"),
    ("EqualKey", "_lost"),
}
# Stale values of these decide nothing: they are told only where they do.
_SOMETIMES = {
    ("ApproximateTime", "_candidate_start"),
    ("ApproximateTime", "_candidate_end"),
    ("ApproximateTime", "_pivot_stamp"),
    ("ApproximateTime", "_proof_end"),
    ("Arrivals", "_given"),
    ("Arrivals", "_jumped"),
}


def slots_of(part):
    kinds = type(part).__mro__
    return [slot for kind in kinds for slot in kind.__dict__.get("__slots__", ()) if hasattr(part, slot)]


def parts_of(value, seen):
    """All objects of the engine that have slots, from one of them on."""
    if id(value) in seen or isinstance(value, MethodType | Message):
        return
    seen.add(id(value))
    if isinstance(value, list | tuple | deque):
        for each in value:
            yield from parts_of(each, seen)
    elif isinstance(value, dict):
        yield from parts_of(list(value.values()), seen)
    elif slots_of(value):
        yield value
        for slot in slots_of(value):
            yield from parts_of(getattr(value, slot), seen)


_CHANGED = {
    bool: lambda value: not value,
    int: lambda value: value + 1,
    float: lambda value: value + 1,
    Message: lambda value: Message(value.input, value.stamp, ("other", value.payload), value.key),
    list: lambda value: [*value[:-1], changed(value[-1])] if value else [1],
    tuple: lambda value: (*value[:-1], changed(value[-1])) if value else (1,),
    set: lambda value: value ^ {0},
    dict: lambda value: {**value, 77: 1},
    deque: lambda value: deque([*value, 1]),
    type(None): lambda _: 1,
}


def changed(value):
    """Another value of the same kind; the same where there is none to be had."""
    return _CHANGED.get(type(value), lambda same: same)(value)


@every_policy
@pytest.mark.parametrize(
    ("optional", "max_wait"),
    [(False, None), (False, 9), (True, 9)],
    ids=["without max_wait", "with max_wait", "with an optional input"],
)
def test_a_change_of_any_slot_is_a_change_of_state(policy, optional, max_wait):
    """So nothing that a policy keeps can be forgotten: what is left out has to stand in this file."""
    chosen = Options(required=(True, True, not optional), max_wait=max_wait, every=2, min_set_period=3)
    group = make_group(policy, chosen)
    for step in pairs_for(policy)(3)[:-1]:
        take(group, step)
    group.add(Message(2, START + 20 * TICK, "third", key=2), now=START + 20 * TICK)
    before, found, unseen = state(group), set(), set()
    for part in list(parts_of(group, set())):
        for slot in slots_of(part):
            value = getattr(part, slot)
            other = changed(value)
            if other == value:
                continue
            # Those that are frozen, too.
            object.__setattr__(part, slot, other)
            found.add((type(part).__name__, slot))
            if state(group) == before:
                unseen.add((type(part).__name__, slot))
            object.__setattr__(part, slot, value)
    assert len(found) > 20
    assert unseen <= _ASIDE | _SOMETIMES
    assert unseen - _SOMETIMES == found & _ASIDE
    assert state(group) == before


def test_all_that_a_candidate_is_known_by_is_state():
    group = make_group("approximate_time", Options(required=(True, True)))
    for step in regular(1):
        take(group, step)
    before = state(group)
    (policy,) = (part for part in parts_of(group, set()) if type(part).__name__ == "ApproximateTime")
    for slot in ("_candidate_start", "_candidate_end", "_pivot_stamp", "_proof_end"):
        value = getattr(policy, slot)
        setattr(policy, slot, value + 1)
        assert state(group) != before
        setattr(policy, slot, value)
    assert state(group) == before


def fed(group, *messages):
    for index, stamp in messages:
        group.add(Message(index, stamp, (index, stamp)), now=START + 999 * TICK)
    return group


def test_what_was_given_to_a_set_is_state_while_it_makes_a_message_late():
    chosen = Options(required=(True, True), queue_size=1)
    after = [(0, START + 1), (1, START + 2)]
    matched = fed(make_group("exact_time", chosen), (0, START), (1, START), *after)
    not_matched = fed(make_group("exact_time", chosen), (1, START), *after)
    assert state(matched) != state(not_matched)
    late = Message(0, START, "late")
    assert [drop.reason for drop in matched.add(late, now=START)] == [DropReason.LATE]
    assert [drop.reason for drop in not_matched.add(late, now=START)] == [DropReason.OVERFLOW]


def test_which_input_jumped_is_state_while_others_have_something_left_over():
    chosen = Options(required=(True, True, True), queue_size=1)
    before = [(index, START) for index in range(3)]
    first, second = (0, START // 2), (1, START // 2 + TICK)
    groups = [fed(make_group("exact_time", chosen), *before, *after) for after in ((first, second), (second, first))]
    assert state(groups[0]) != state(groups[1])
    groups = [fed(group, (2, START // 2 + 2 * TICK)) for group in groups]
    assert state(groups[0]) == state(groups[1])


def test_which_optional_input_came_first_is_no_state():
    chosen = Options(required=(True, False, False), max_wait=9)
    messages = (1, START), (2, START)
    assert state(fed(make_group("exact_time", chosen), *messages)) == state(
        fed(make_group("exact_time", chosen), *reversed(messages))
    )


def test_messages_of_other_names_are_another_state():
    groups = [make_group("approximate_time", Options(required=(True, True))) for _ in range(2)]
    for payload, group in enumerate(groups):
        group.add(Message(0, START, payload), now=START)
    assert state(groups[0]) != state(groups[1])
    assert groups[0].state(lambda _: "same") == groups[1].state(lambda _: "same")


def test_a_value_without_attributes_is_refused():
    with pytest.raises(TypeError, match="has no state that can be told"):
        state_of(object(), name)
    with pytest.raises(TypeError, match="has no state that can be told"):
        state_of([Match.__init__], name)


def test_what_was_given_long_ago_is_no_state_but_what_was_given_lately_is():
    chosen = Options(required=(True, True, False), max_wait=1)
    groups = [make_group("exact_time", chosen) for _ in range(2)]
    for place, group in enumerate(groups):
        stamp = START + place * TICK
        for index in range(3):
            group.add(Message(index, stamp, place), now=stamp)
    assert state(groups[0]) != state(groups[1])
    later = START + 200 * TICK
    for group in groups:
        group.add(Message(2, later, "later"), now=later)
        for index in range(2):
            group.add(Message(index, later - TICK, "later"), now=later + TICK)
        group.expire(now=later + 9 * TICK)
    assert state(groups[0]) == state(groups[1])
