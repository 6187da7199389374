"""A table of drawn cases as one parametrized test."""

import pytest

from tests.sync.support.timeline import play_group, play_policy


def policy_cases(cases):
    """`cases`: a sentence -> (a function that makes the policy, a drawing)."""

    @pytest.mark.parametrize(("make", "drawing"), cases.values(), ids=cases)
    def test(make, drawing):
        left, drawn = play_policy(make(), drawing)
        assert left == drawn

    return test


def group_cases(cases):
    """`cases`: a sentence -> (a function that makes the group, a drawing)."""

    @pytest.mark.parametrize(("make", "drawing"), cases.values(), ids=cases)
    def test(make, drawing):
        left, drawn = play_group(make(), drawing)
        assert left == drawn

    return test
