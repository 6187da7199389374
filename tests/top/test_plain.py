"""The state as plain text."""

import pytest

from syncrelay.status import status_of
from syncrelay.status.document import read_status
from syncrelay.top.client import Answer
from syncrelay.top.plain import group_lines, plain_text
from tests.top import states


@pytest.mark.parametrize("state", states.ALL.values(), ids=states.ALL)
def test_all_that_is_found_is_said_in_lines_of_80_columns(state):
    told = status_of(state()).as_json()
    text = plain_text(Answer("http://robot:9464", told, read_status(told)))
    assert all(len(line) <= 80 or len(line.split()) == 1 for line in text.splitlines())
    flowing = " ".join(text.split())
    for group in state().groups:
        assert f"{group.facts.name}: " in flowing
        for finding in group.findings:
            assert finding.text in flowing
            assert (finding.suggestion or "") in flowing
        for each in group.facts.inputs:
            assert f"{each.name}" in flowing
            assert f"{each.counts.fed} received, {each.counts.matched} in sets" in flowing


@pytest.mark.parametrize("state", states.ALL.values(), ids=states.ALL)
def test_a_narrow_terminal_has_narrow_lines(state):
    for group in status_of(state()).groups:
        wide, narrow = list(group_lines(group)), list(group_lines(group, width=50))
        assert all(len(line) <= 50 or len(line.split()) == 1 for line in narrow)
        assert " ".join(wide).split() == " ".join(narrow).split()
        assert " ".join(group_lines(group, width=1)).split() == " ".join(wide).split()
