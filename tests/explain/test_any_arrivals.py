"""Whatever is stamped and received, and whenever, is observed, judged and tried without an error."""

import random

import pytest

from syncrelay.explain import Code, Severity
from syncrelay.explain.causes import EXPLAINS, explained_by
from tests.bank.any_arrivals import judged
from tests.faults.extent import chosen

# The last ones have failed: of an input that lost its clock, and then had no stamp, and of one too late for any wait.
_SEEDS = (
    *(chosen(short=1, long=random.randrange(10**9)) + n for n in range(chosen(short=20, long=3000))),
    61086329,
    445577680,
)


@pytest.mark.parametrize("seed", _SEEDS)
def test_any_messages_are_judged(seed: int):
    for facts, found in judged(seed):
        assert found
        assert all(each.text for each in found)
        said = {each.code for each in found}
        # A group whose messages have just begun gets time for its first set.
        if facts.is_silent and facts.had_time and Code.STARTING not in said:
            assert any(each.severity is Severity.ERROR for each in found), found
        for each in found:
            if each.explains and each.input is None and each.code in EXPLAINS:
                assert not said & explained_by(each.code)
