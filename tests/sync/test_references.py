"""The engine's policies against slow, obvious ones, on streams with every disorder."""

import random
from collections import Counter

import pytest

from syncrelay.sync import (
    ApproximateEpsilonTime,
    ApproximateTime,
    ApproximateTimeEager,
    EqualKey,
    ExactTime,
    LatestTime,
    Match,
    Message,
)
from tests.faults.extent import chosen
from tests.sync.support.reference_approximate_time import ReferenceApproximateTime
from tests.sync.support.references import (
    ReferenceEager,
    ReferenceEpsilon,
    ReferenceEqualKey,
    ReferenceExactTime,
    ReferenceLatest,
)
from tests.sync.support.streams import AGE_PENALTIES, MS, disordered, gappy

_STREAMS = chosen(short=100, long=3_000)


def tolerances(rng, sizes):
    return rng.choice((None, [rng.choice((None, 0, 2 * MS, 9 * MS, 40 * MS)) for _ in range(sizes["n_inputs"])]))


def approximate_time(rng, sizes):
    options = {
        "tolerances_ns": tolerances(rng, sizes),
        "slop_ns": rng.choice((0, 5 * MS, 50 * MS, 500 * MS, None)),
        "age_penalty": rng.choice((*AGE_PENALTIES, 0.7)),
        "min_periods_ns": [rng.choice((0, 0, 8 * MS, 60 * MS)) for _ in range(sizes["n_inputs"])],
    }
    return ApproximateTime(**sizes, **options), ReferenceApproximateTime(**sizes, **options)


def exact_time(_, sizes):
    return ExactTime(**sizes), ReferenceExactTime(**sizes)


def approximate_time_eager(rng, sizes):
    options = {"slop_ns": rng.choice((0, 5 * MS, 30 * MS, 100 * MS, None)), "tolerances_ns": tolerances(rng, sizes)}
    return ApproximateTimeEager(**sizes, **options), ReferenceEager(**sizes, **options)


def approximate_epsilon_time(rng, sizes):
    options = {"epsilon_ns": rng.choice((0, 5 * MS, 50 * MS, 500 * MS, None)), "tolerances_ns": tolerances(rng, sizes)}
    return ApproximateEpsilonTime(**sizes, **options), ReferenceEpsilon(**sizes, **options)


def latest_time(rng, sizes):
    required = [rng.random() < 0.7 for _ in range(sizes["n_inputs"])]
    options = {
        "trigger": rng.randrange(sizes["n_inputs"]),
        "max_ages_ns": [rng.choice((None, 0, 20 * MS, 200 * MS)) for _ in range(sizes["n_inputs"])],
        "required": required,
        "quorum": rng.randint(0, sizes["n_inputs"]),
    }
    required[options["trigger"]] = True
    return LatestTime(**sizes, **options), ReferenceLatest(**sizes, **options)


def equal_key(_, sizes):
    return EqualKey(**sizes), ReferenceEqualKey(**sizes)


POLICIES = [approximate_time, exact_time, approximate_time_eager, approximate_epsilon_time, latest_time, equal_key]


def told(outcomes):
    sets = [outcome for outcome in outcomes if isinstance(outcome, Match)]
    return sets, Counter(outcome for outcome in outcomes if not isinstance(outcome, Match))


@pytest.mark.parametrize("make", POLICIES, ids=lambda make: make.__name__)
def test_a_policy_gives_what_its_reference_gives(make):
    sets = 0
    for seed in range(_STREAMS):
        rng = random.Random(seed)
        sizes = {"n_inputs": rng.choice((1, 2, 2, 3, 4)), "queue_size": rng.choice((1, 2, 3, 5, 20))}
        policy, reference = make(rng, sizes)
        for number, (index, stamp) in enumerate(disordered(rng, sizes["n_inputs"], rng.randint(20, 120))):
            message = Message(index, stamp, number, key=stamp // (20 * MS))
            given = policy.add(message)
            assert told(given) == told(reference.add(message)), f"seed {seed}, event {number}"
            assert policy.waits_started - policy.waits_ended == reference.waiting(), f"seed {seed}, event {number}"
            sets += len(told(given)[0])
    assert sets > 3 * _STREAMS, "too few sets to prove anything"


def test_long_searches_give_what_single_steps_give():
    for seed in range(_STREAMS // 5):
        rng = random.Random(seed)
        sizes = {"n_inputs": rng.randint(2, 5), "queue_size": rng.choice((10, 50))}
        policy, reference = approximate_time(rng, sizes)
        for number, (index, stamp) in enumerate(gappy(rng, sizes["n_inputs"], 300)):
            message = Message(index, stamp, number)
            assert told(policy.add(message)) == told(reference.add(message)), f"seed {seed}, event {number}"
