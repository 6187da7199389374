"""Faults drawn by fresh seeds: how often the first sentence names the one that was drawn, its input and figures."""

import time
from math import sqrt

import pytest

from tests.bank.kinds import KINDS
from tests.bank.play import Score, drawn, play
from tests.faults.extent import chosen

# What is reached; it may only rise. Draws are by chance, so three standard errors less are let pass.
_TOLD = 0.87
_WELL = 0.99
_CURED = 0.96
_FIRST = time.time_ns() // 1_000_000_000 % 1_000_000_000


def _least(share: float, count: int) -> float:
    return share - 3 * sqrt(share * (1 - share) / max(1, count))


@pytest.mark.long
def test_the_first_sentence_names_the_fault_that_was_drawn():
    count = chosen(short=80, long=2000)
    results = [play(drawn(seed, tuple(KINDS), 1)) for seed in range(_FIRST, _FIRST + count)]
    told = [each for each in results if each.score is Score.TOLD]
    missed = [(each.drawn.seed, each.drawn.kinds, each.score.value, each.why) for each in results if each not in told]
    assert len(told) >= _least(_TOLD, count) * count, missed
    offered = [each for each in told if each.cure != "nothing offered" and any(of.moments for of in each.drawn.truths)]
    failed = [(each.drawn.seed, each.drawn.kinds, each.cure) for each in offered if each.cure]
    assert len(failed) <= (1 - _least(_CURED, len(offered))) * len(offered), failed


@pytest.mark.long
def test_of_a_rig_that_is_well_nothing_is_said():
    count = chosen(short=25, long=2000)
    results = [play(drawn(seed, (), 0)) for seed in range(_FIRST, _FIRST + count)]
    warned = [(each.drawn.seed, each.said, each.lasted) for each in results if each.score is not Score.TOLD]
    assert len(warned) <= (1 - _least(_WELL, count)) * count, warned
