"""Of draws with fixed seeds, all that is said and shown is what is known; of any other, something is."""

import random

import pytest

from tests.bank.any_facts import said_of
from tests.bank.any_trials import answers
from tests.bank.known import KNOWN, Fixed, known
from tests.faults.extent import chosen


@pytest.mark.long
@pytest.mark.parametrize("block", KNOWN.read_text().split("\n\n"), ids=lambda block: block.partition("\n")[0])
def test_what_is_said_of_a_draw_is_what_is_known(block):
    assert known(Fixed.named(block.partition("\n")[0])).splitlines() == block.splitlines()


@pytest.mark.parametrize("told", [said_of, answers])
def test_any_are_answered(told):
    seeds = range(chosen(short=2, long=3000))
    assert all(list(told(random.Random(f"others {seed}"))) for seed in seeds)
