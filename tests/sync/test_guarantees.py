"""What is promised of every policy and group, whatever happens to them: a property for each promise."""

from collections import Counter
from dataclasses import replace

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from syncrelay.sync import Drop, DropReason, Match, Message
from tests.faults.extent import chosen
from tests.sync.support.rigs import (
    BY_CLOCK,
    ONCE,
    POLICIES,
    START,
    TICK,
    Options,
    Tally,
    few,
    finish,
    make_group,
    make_policy,
    members,
    options,
    run,
    steps,
    take,
)

few_examples = settings(max_examples=chosen(short=8, long=400))


def every_policy(test):
    return pytest.mark.parametrize("policy", POLICIES)(few_examples(test))


def also_by_clock(test):
    return pytest.mark.parametrize("policy", [*POLICIES, *BY_CLOCK])(few_examples(test))


@st.composite
def rigs(draw, *, disorder=True, jumps=True, **kinds):
    chosen = draw(options(**kinds))
    return chosen, draw(steps(chosen.n_inputs, disorder=disorder, jumps=jumps))


def sets_of(outcomes):
    return [outcome for outcome in outcomes if isinstance(outcome, Match)]


def flat(left):
    return [outcome for outcomes in left for outcome in outcomes]


@also_by_clock
@given(rig=rigs())
def test_fed_is_matched_and_dropped_and_buffered_at_any_moment(policy, rig):
    chosen, taken = rig
    group = make_group(policy, chosen)
    tally = Tally(chosen.n_inputs)
    for step in taken:
        tally.note(step.message, take(group, step))
        assert tally.agrees(group)
    left = group.flush(DropReason.SHUTDOWN)
    assert all(drop.reason is DropReason.SHUTDOWN for drop in left)
    assert [counts.buffered for counts in group.counts()] == [0] * chosen.n_inputs


@also_by_clock
@given(rig=rigs())
def test_each_message_leaves_once_in_a_set_or_as_a_drop_with_one_reason(policy, rig):
    chosen, taken = rig
    left = flat(finish(make_group(policy, chosen), taken))
    dropped = Counter(outcome.message for outcome in left if isinstance(outcome, Drop))
    matched = Counter(message for match in sets_of(left) for message in members(match))
    fed = Counter(step.message for step in taken if step.message is not None)
    if policy in ONCE:
        assert dropped + matched == fed
    assert dropped + Counter(set(matched)) == fed


@every_policy
@given(rig=rigs(disorder=False))
def test_sets_leave_in_the_order_of_their_stamps(policy, rig):
    chosen, taken = rig
    left = sets_of(flat(run(make_group(policy, chosen), taken)))
    first = chosen.required.index(True)
    for index in range(chosen.n_inputs):
        stamps = [match.messages[index].stamp for match in left if match.messages[index] is not None]
        if policy == "equal_key" or (policy == "latest_time" and index != first):
            assert stamps == sorted(stamps)
        else:
            assert stamps == sorted(set(stamps))
    if all(chosen.required):
        for pick in (min, max):
            picked = [pick(shifted(match, chosen)) for match in left]
            assert picked == sorted(picked)


def shifted(match, chosen, inputs=(True,) * 9):
    offsets = chosen.offsets or (0,) * chosen.n_inputs
    kept = [message for message in members(match) if inputs[message.input]]
    return [message.stamp + offsets[message.input] * TICK for message in kept]


@also_by_clock
@given(rig=rigs(jumps=False))
def test_without_a_jump_no_input_ever_goes_back(policy, rig):
    chosen, taken = rig
    left = sets_of(flat(run(make_group(policy, chosen), taken)))
    for index in range(chosen.n_inputs):
        messages = [match.messages[index] for match in left if match.messages[index] is not None]
        stamps = [message.stamp for message in messages if message.stamp]
        assert stamps == sorted(stamps)


@every_policy
@given(rig=rigs())
def test_a_set_has_all_required_inputs_and_fits(policy, rig):
    chosen, taken = rig
    for match in sets_of(flat(run(make_group(policy, chosen), taken))):
        assert [message.input for message in members(match)] == [
            index for index, message in enumerate(match.messages) if message is not None
        ]
        assert all(match.messages[index] for index, needed in enumerate(chosen.required) if needed)
        assert len(members(match)) >= (chosen.quorum or 0)
        stamps = shifted(match, chosen)
        if policy == "equal_key":
            assert len({message.key for message in members(match)}) == 1
        else:
            assert max(stamps) - min(stamps) <= (0 if policy == "exact_time" else chosen.slop * TICK)
        if policy == "latest_time":
            assert max(stamps) == stamps[members(match).index(match.messages[chosen.required.index(True)])]


@every_policy
@given(rig=rigs(optional=False, limited=False), shift=st.integers(-START, START))
def test_without_max_wait_the_clock_changes_nothing(policy, rig, shift):
    chosen, taken = rig
    assume(chosen.min_set_period is None or policy != "equal_key")
    later = [step.shifted(shift * number) for number, step in enumerate(taken)]
    assert run(make_group(policy, chosen), taken) == run(make_group(policy, chosen), later)


@also_by_clock
@given(rig=rigs())
def test_expiring_more_often_changes_nothing_that_is_due(policy, rig):
    chosen, taken = rig
    group, eager = make_group(policy, chosen), make_group(policy, chosen)
    clock = START
    for step in taken:
        clock = max(clock, step.now)  # a clock that rises: one that falls is seen when it is seen
        expected = list(take(group, replace(step, now=clock)))
        before = []
        while (deadline := eager.next_deadline()) is not None and deadline <= clock:
            before += eager.expire(now=clock)
        assert [*before, *take(eager, replace(step, now=clock))] == expected
        assert list(eager.expire(now=clock)) == []


@every_policy
@given(rig=rigs())
def test_nothing_waits_longer_than_max_wait_even_when_the_clock_falls(policy, rig):
    chosen, taken = rig
    group = make_group(policy, chosen)
    for step in taken:
        take(group, step)
        deadline = group.next_deadline()
        if chosen.max_wait is None:
            assert deadline is None
        else:
            assert deadline is None or step.now < deadline <= step.now + chosen.max_wait * TICK


@every_policy
@given(rig=rigs())
def test_what_is_buffered_is_bounded(policy, rig):
    chosen, taken = rig
    group = make_group(policy, chosen)
    for step in taken:
        take(group, step)
        # A queue, the sets that wait for optional inputs, and what thinning may yet let pass.
        assert all(counts.buffered <= 2 * chosen.queue_size + 1 for counts in group.counts())
    if all(chosen.required) and chosen.every == 1 and chosen.min_set_period is None:
        assert all(counts.buffered <= chosen.queue_size for counts in group.counts())


@every_policy
@given(rig=rigs(thinned=False, disorder=False))
def test_optional_inputs_never_change_which_required_messages_go_together(policy, rig):
    chosen, taken = rig
    assume(not all(chosen.required))
    chosen = replace(chosen, quorum=None)
    mixed = sets_of(flat(run(make_group(policy, chosen), taken)))
    alone = replace(
        chosen,
        required=(True,) * sum(chosen.required),
        offsets=only_required(chosen.offsets, chosen),
        min_periods=only_required(chosen.min_periods, chosen),
        max_ages=only_required(chosen.max_ages, chosen),
        restamp=None,
    )
    places = {index: place for place, index in enumerate(only_required(range(chosen.n_inputs), chosen))}
    group = make_group(policy, alone)
    expected = []
    for step in taken:
        if step.message is not None and step.message.input in places:
            moved = replace(step, message=replace(step.message, input=places[step.message.input]))
        else:
            moved = replace(step, message=None)
        expected += [[message.payload for message in match.messages] for match in sets_of(take(group, moved))]
    found = [[match.messages[index].payload for index in places] for match in mixed]
    assert found == expected[: len(found)]
    if policy != "equal_key":
        assert len(expected) - len(found) <= chosen.queue_size, "sets wait, they don't vanish"


def only_required(values, chosen):
    return tuple(value for value, needed in zip(values, chosen.required, strict=False) if needed)


@every_policy
@given(rig=rigs(disorder=False, thinned=False), every=few(1, 4), period=few(1, 8))
def test_thinning_lets_some_sets_pass_whole_and_evenly(policy, rig, every, period):
    chosen, taken = rig
    whole = sets_of(flat(run(make_group(policy, chosen), taken)))
    each = sets_of(flat(run(make_group(policy, replace(chosen, every=every)), taken)))
    assert each == whole[::every]
    rated = sets_of(flat(run(make_group(policy, replace(chosen, min_set_period=period)), taken)))
    assert [match for match in whole if match in rated] == rated
    assert rated[:1] == whole[:1]
    stamps = [max(shifted(match, chosen, chosen.required)) for match in rated]
    for first in range(len(stamps)):
        for last in range(first, len(stamps)):
            assert last - first + 1 <= (stamps[last] - stamps[first]) // (period * TICK) + 2


@every_policy
@given(rig=rigs(disorder=False), gap=few(101, 500))
def test_the_second_pass_of_a_looped_recording_gives_the_sets_of_the_first(policy, rig, gap):
    chosen, taken = rig
    taken = [step for step in taken if step.message is not None]
    assume(taken)
    # A recording long enough for a jump, in which each input has a message at the end.
    ends = [
        Message(index, taken[-1].message.stamp + gap * TICK, -1 - index, key=-1 - index)
        for index in range(chosen.n_inputs)
    ]
    last = replace(taken[-1], message=None).shifted(10 * TICK)  # time enough for what waits
    recording = [*taken, *(replace(taken[-1], message=end) for end in ends), last]
    length = gap * TICK * 10
    again = [step.shifted(length) for step in recording]
    group = make_group(policy, chosen)
    one = run(group, recording)
    two = run(group, again)
    assert sets_of(flat(two)) == sets_of(flat(one))


@pytest.mark.parametrize("policy", POLICIES)
def test_the_queue_that_was_needed_is_told_and_would_have_matched(policy):
    """Input 0 is twelve ticks behind input 1, whose queue has lost what its message needs."""

    def fed(queue_size):
        subject = make_policy(policy, Options(required=(True, True), queue_size=queue_size, slop=0))
        for tick in range(1, 21):
            subject.add(Message(1, tick * TICK, None, key=tick))
        assert subject.needed_queue(1) is None
        return subject, sets_of(subject.add(Message(0, 8 * TICK, None, key=8)))

    subject, left = fed(5)
    needed = subject.needed_queue(1)
    assert (left, subject.needed_queue(0)) == ([], None)
    if not fed(40)[1]:
        # A policy that makes sets of the newest messages alone has no use for a longer queue.
        assert needed is None
        return
    assert needed is not None
    # From 8 to 20 are thirteen, and some policies count one more to be safe.
    assert [len(fed(size)[1]) for size in (12, needed)] == [0, 1]
    assert needed in (13, 14)
