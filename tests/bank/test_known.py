"""Of draws with fixed seeds, all that is said and shown is what is known."""

import pytest

from tests.bank.known import KNOWN, Fixed, known


@pytest.mark.long
@pytest.mark.parametrize("block", KNOWN.read_text().split("\n\n"), ids=lambda block: block.partition("\n")[0])
def test_what_is_said_of_a_draw_is_what_is_known(block):
    assert known(Fixed.named(block.partition("\n")[0])).splitlines() == block.splitlines()
