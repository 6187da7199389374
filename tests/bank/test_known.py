"""Of draws with fixed seeds, all that is said and shown is what is known; of any other, something is."""

import random

import pytest

from tests.bank.any_facts import said_of
from tests.bank.any_trials import answers
from tests.bank.known import KNOWN, Fixed, known
from tests.bank.limits import LIMITS, Limit
from tests.faults.extent import chosen

_LINES = LIMITS.read_text().splitlines()
AT_ONCE = [_LINES[begin : begin + 20] for begin in range(0, len(_LINES), 20)]


@pytest.mark.long
@pytest.mark.parametrize("block", KNOWN.read_text().split("\n\n"), ids=lambda block: block.partition("\n")[0])
def test_what_is_said_of_a_draw_is_what_is_known(block):
    assert known(Fixed.named(block.partition("\n")[0])).splitlines() == block.splitlines()


@pytest.mark.long
@pytest.mark.parametrize("lines", AT_ONCE, ids=lambda lines: lines[0].rpartition(" ")[0])
def test_what_is_said_becomes_another_where_it_is_known_to(lines):
    assert [Limit.of(line).line() for line in lines] == lines


@pytest.mark.parametrize("told", [said_of, answers])
def test_any_are_answered(told):
    seeds = range(chosen(short=2, long=3000))
    assert all(list(told(random.Random(f"others {seed}"))) for seed in seeds)
