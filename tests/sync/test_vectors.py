"""The peers' own test cases: the engine gives the same, or what `vectors/ours.json` says, with its reason."""

import json
from pathlib import Path

import pytest

from syncrelay.sync import (
    ApproximateEpsilonTime,
    ApproximateTime,
    ApproximateTimeEager,
    DropReason,
    ExactTime,
    LatestTime,
    Match,
    Message,
    SyncGroup,
)

FOLDER = Path(__file__).parent / "vectors"
SHIFT_NS = 10**12
"""Upstream's cases begin at 0, which to a group is an unset stamp."""

NO_LIMIT_NS = 10**15
OURS = json.loads((FOLDER / "ours.json").read_text())
CASES = [
    case
    for path in sorted(FOLDER.glob("**/*.json"))
    if path.name != "ours.json"
    for case in json.loads(path.read_text())
]


def make_policy(case):
    params = case["params"]
    sizes = {"n_inputs": case["n_inputs"], "queue_size": params.get("queue_size") or 1_000}
    match case["policy"]:
        case "approximate_adaptive":
            return ApproximateTime(
                **sizes,
                slop_ns=NO_LIMIT_NS if params["max_interval_ns"] is None else params["max_interval_ns"],
                age_penalty=params["age_penalty"],
                min_periods_ns=params["inter_message_lower_bound_ns"],
            )
        case "fkie_approximate":
            return ApproximateTime(**sizes, slop_ns=params["max_age_ns"])
        case "approximate_epsilon":
            return ApproximateEpsilonTime(**sizes, epsilon_ns=params["epsilon_ns"])
        case "approximate_slop":
            return ApproximateTimeEager(**sizes, slop_ns=params["slop_ns"])
        case "exact" | "exact_cpp" | "exact_python" | "fkie_exact":
            return ExactTime(**sizes)
        case "latest":
            return LatestTime(**sizes, trigger=0)


def play(case):
    policy = make_policy(case)
    group = SyncGroup(policy, required=(True,) * policy.n_inputs)
    sets, drops = [], []
    for event, (index, stamp, *_) in enumerate(case["events"]):
        for outcome in group.add(Message(index, stamp + SHIFT_NS, event), now=0):
            if isinstance(outcome, Match):
                members = [message for message in outcome.messages if message is not None]
                sets.append([event, [message.stamp - SHIFT_NS for message in members]])
                assert [case["events"][message.payload][1] for message in members] == sets[-1][1]
            elif outcome.reason in (DropReason.SUPERSEDED, DropReason.OVERFLOW):
                drops.append([event, outcome.message.input, outcome.message.stamp - SHIFT_NS])
    return sets, drops


def observed(case, what, otherwise):
    return case.get("observed", {}).get(what) or case[otherwise] or []


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
def test_a_case_gives_what_the_peer_gives_or_what_is_ours(case):
    sets, drops = play(case)
    theirs = observed(case, "emitted", "expected")
    if case["name"] in OURS:
        assert sets == OURS[case["name"]]["sets"]
        assert sets != theirs, "no longer different"
        return
    assert sets == theirs
    if case["policy"] in ("exact", "exact_cpp") and case.get("semantics") != "python":
        dropped = observed(case, "dropped", "expected_dropped")
        told = [
            [event, index, stamp]
            for event, stamps in dropped
            for index, stamp in enumerate(stamps)
            if stamp is not None
        ]
        assert drops == told


def test_every_difference_is_of_a_case_and_has_its_reason():
    assert OURS.keys() <= {case["name"] for case in CASES}
    assert all(len(ours["why"]) > 20 for ours in OURS.values())
