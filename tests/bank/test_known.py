"""Of draws with fixed seeds, all that is said and shown is what is known."""

import pytest

from tests.bank.known import FIXED, KNOWN, known

_KNOWN = {text.splitlines()[0]: text.splitlines() for text in KNOWN.read_text().split("\n\n")}


@pytest.mark.long
@pytest.mark.parametrize("fixed", FIXED, ids=[each.name for each in FIXED])
def test_what_is_said_of_a_draw_is_what_is_known(fixed):
    assert known(fixed).splitlines() == _KNOWN[fixed.name]
