"""The timelines that the policies' docstrings show are true."""

import textwrap
from typing import TypedDict

import pytest

from syncrelay.sync import (
    ApproximateEpsilonTime,
    ApproximateTime,
    ApproximateTimeEager,
    EqualKey,
    ExactTime,
    LatestAtTicks,
    LatestTime,
    SyncGroup,
    Ticks,
)
from tests.sync.support.rigs import EXPORTED
from tests.sync.support.timeline import TICK_NS, play_group


class Sizes(TypedDict):
    n_inputs: int
    queue_size: int


SIZES: Sizes = {"n_inputs": 2, "queue_size": 10}
POLICIES = [
    ExactTime(**SIZES),
    ApproximateTime(**SIZES, slop_ns=5 * TICK_NS),
    ApproximateTimeEager(**SIZES, slop_ns=2 * TICK_NS),
    ApproximateEpsilonTime(**SIZES, epsilon_ns=TICK_NS),
    LatestTime(**SIZES, trigger=0),
    LatestAtTicks(**SIZES, ticks=Ticks(20)),
    EqualKey(**SIZES),
]


def test_each_policy_is_here():
    assert set(map(type, POLICIES)) == EXPORTED


def drawing_in(docstring):
    """The lines that are indented deeper than the text."""
    lines = textwrap.dedent("    " + docstring).splitlines()
    return "\n".join(line for line in lines if line.startswith("    "))


@pytest.mark.parametrize("policy", POLICIES, ids=lambda policy: type(policy).__name__)
def test_the_drawing_of_a_policy_is_what_it_does(policy):
    left, drawn = play_group(SyncGroup(policy), drawing_in(type(policy).__doc__))
    assert left == drawn
    assert len(left) > 0
