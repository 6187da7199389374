"""Options of policies that are out of range are refused."""

from typing import Any

import pytest

from syncrelay.sync import (
    ApproximateEpsilonTime,
    ApproximateTime,
    ApproximateTimeEager,
    EqualKey,
    ExactTime,
    LatestAtTicks,
    LatestTime,
    Ticks,
)
from tests.sync.support.rigs import EXPORTED

SIZES: list[dict[str, Any]] = [{"n_inputs": -1}, {"queue_size": 0}]
OF_LATEST: list[dict[str, Any]] = [{"required": (True,)}, {"max_ages_ns": (None, -1)}, {"max_ages_ns": (None,)}]
TOLERANCES: list[dict[str, Any]] = [{"tolerances_ns": tolerances} for tolerances in ((None,), (None, -1))]
RIGHT: dict[Any, dict[str, Any]] = {
    ExactTime: {},
    ApproximateTime: {"slop_ns": 1},
    ApproximateTimeEager: {"slop_ns": 1},
    ApproximateEpsilonTime: {"epsilon_ns": 1},
    LatestTime: {"trigger": 0},
    LatestAtTicks: {"ticks": Ticks(20)},
    EqualKey: {},
}
WRONG: dict[Any, list[dict[str, Any]]] = {
    ApproximateTime: [
        {"slop_ns": -1},
        *({"age_penalty": age_penalty} for age_penalty in (-0.1, float("inf"), float("nan"))),
        *({"min_periods_ns": periods} for periods in ((0,), (0, -1))),
        *TOLERANCES,
    ],
    ApproximateTimeEager: [{"slop_ns": -1}, *TOLERANCES],
    ApproximateEpsilonTime: [{"epsilon_ns": -1}, *TOLERANCES],
    LatestTime: [{"trigger": -1}, {"trigger": 2}, {"required": (False, True)}, *OF_LATEST],
    LatestAtTicks: [{"required": (False, False)}, *OF_LATEST],
}
CASES = [(policy, wrong) for policy in RIGHT for wrong in (*SIZES, *WRONG.get(policy, ()))]


def test_each_policy_is_here():
    assert set(RIGHT) == EXPORTED


@pytest.mark.parametrize(("policy", "wrong"), CASES, ids=lambda value: getattr(value, "__name__", str(value)))
def test_options_out_of_range_are_refused(policy, wrong):
    right = {"n_inputs": 2, "queue_size": 1, **RIGHT[policy]}
    assert policy(**right)
    with pytest.raises(ValueError, match="must be"):
        policy(**{**right, **wrong})


@pytest.mark.parametrize("rate", [(0, 1), (-1, 1), (1, 0)])
def test_a_rate_that_is_not_above_0_is_refused(rate):
    with pytest.raises(ValueError, match="must be 1 or more"):
        Ticks(*rate)
