"""Groups of every policy against a slow, obvious one, on streams with every disorder, with any options."""

import random
from collections import Counter

import pytest

from syncrelay.sync import DropReason, Match, Message, Restamp
from tests.faults.extent import chosen
from tests.sync.support.reference_group import ByKey, ByStamp, ReferenceGroup
from tests.sync.support.references import ReferenceAtTicks
from tests.sync.support.rigs import BY_CLOCK, OF_ANY, POLICIES, START, TICK, Options, Tally, make_group, make_policy

GROUPS = chosen(short=200, long=2_000)
LAGS = (0,) * 8 + (1, 1, 2, 3, 5, 8, 13, 99, 100, 101, 102, 250)
FALLS = (0,) * 40 + (1, 30)


def drawn(rng, policy):
    n_inputs = rng.choice((1, 2, 2, 3, 3, 4))
    required = [rng.random() < 0.6 for _ in range(n_inputs)]
    if policy not in OF_ANY or rng.random() < 0.6:
        required[rng.randrange(n_inputs)] = True
    quorum = rng.randint(max(1, sum(required)), n_inputs)
    quorum = rng.choice((quorum, sum(required) or quorum))
    has_tolerances = policy.startswith("approximate") and rng.random() < (0.4 if any(required) else 0.8)
    restamps = (None, Restamp.EARLIEST, Restamp.LATEST, rng.randrange(n_inputs))
    may_wait_forever = all(required) or policy in ("latest_time", *BY_CLOCK)
    return Options(
        required=tuple(required),
        quorum=quorum,
        queue_size=rng.choice((1, 2, 3, 9)),
        slop=rng.randrange(6),
        age_penalty=rng.choice((0.0, 0.1, 2.0)),
        min_periods=rng.choice(((), tuple(rng.randrange(4) for _ in required))),
        max_ages=rng.choice(((), tuple(rng.choice((None, 0, 2, 5)) for _ in required))),
        tolerances=tuple(rng.choice((None, 0, 1, 1.5, 2)) for _ in required) if has_tolerances else (),
        max_wait=rng.choice((*[None] * may_wait_forever, 0, 3, 8)),
        offsets=rng.choice(((), tuple(rng.randrange(-5, 6) for _ in required))),
        restamp=rng.choice((*restamps, Restamp.TICK) if policy in BY_CLOCK else restamps),
        every=rng.choice((1, 1, 2, 3)),
        min_set_period=rng.choice((None, None, 1, 4)),
    )


def reference(policy, options):
    def stage(optional):
        if policy == "equal_key":
            return ByKey(optional, options.n_inputs, options.queue_size)
        steps = options.min_periods if policy == "approximate_time" else ()
        return ByStamp(
            optional,
            options.n_inputs,
            options.queue_size,
            0 if policy == "exact_time" else options.slop * TICK,
            steps=[step * TICK for step in steps or (0,) * options.n_inputs],
            tolerances=[
                each if each is None else int(each * TICK) for each in options.tolerances or (None,) * options.n_inputs
            ],
        )

    made = make_policy(policy, options)
    return ReferenceGroup(
        ReferenceAtTicks(made, options, options.required, options.quorum) if policy in BY_CLOCK else made,
        required=options.required,
        quorum=options.quorum,
        max_wait_ns=None if options.max_wait is None else options.max_wait * TICK,
        offsets_ns=[offset * TICK for offset in options.offsets],
        restamp=options.restamp,
        every=options.every,
        min_set_period_ns=None if options.min_set_period is None else options.min_set_period * TICK,
        stage=stage,
    )


def steps(rng, n_inputs):
    """What happens to a group: messages, many of one input; deadlines, flushes, pauses; the clock falls at times."""
    newest = clock = START
    inputs = [*range(n_inputs), *[rng.randrange(n_inputs)] * rng.choice((0, 4))]
    for number in range(rng.randrange(120)):
        advance = rng.choice((0, 0, 1, 1, 2, 3)) * TICK
        newest += advance
        clock += advance - rng.choice(FALLS) * TICK
        match rng.randrange(100):
            case 0:
                yield "flush", (DropReason.SHUTDOWN,), {}
            case 1:
                yield "let_go", (DropReason.PAUSED,), {}
            case 2:
                yield "pass_over", (), {"now": clock}
            case step if step < 15:
                yield "expire", (), {"now": clock}
            case _:
                stamp = rng.random() > 0.02 and newest - rng.choice(LAGS) * TICK + rng.choice((0, 0, 0, 1, -1))
                key = newest // (2 * TICK) + rng.randrange(3)
                yield "add", (Message(rng.choice(inputs), int(stamp), number, key=key),), {"now": clock}


def told(outcomes):
    sets = [outcome for outcome in outcomes if isinstance(outcome, Match)]
    return sets, Counter(outcome for outcome in outcomes if not isinstance(outcome, Match))


@pytest.mark.parametrize("policy", [*POLICIES, *BY_CLOCK])
def test_a_group_does_what_the_slow_one_does(policy):
    left: Counter[object] = Counter()
    for seed in range(GROUPS):
        rng = random.Random(seed)
        options = drawn(rng, policy)
        group, slow, tally = make_group(policy, options), reference(policy, options), Tally(options.n_inputs)
        for number, (call, arguments, at) in enumerate(steps(rng, options.n_inputs)):
            outcomes = getattr(group, call)(*arguments, **at) or ()
            case = f"seed {seed}, step {number}, {options}"
            assert told(outcomes) == told(getattr(slow, call)(*arguments, **at) or ()), case
            assert group.next_deadline() == slow.next_deadline(), case
            tally.note(arguments[0] if call == "add" else None, outcomes)
            assert tally.agrees(group), case
            left.update("set" if isinstance(each, Match) else each.reason for each in outcomes)
    assert left["set"] > GROUPS, "too few sets to prove anything"
    assert all(left[reason] for reason in (DropReason.LATE, DropReason.TIME_JUMP, DropReason.THINNED)), left
