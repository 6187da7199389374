"""The sentence on all groups: what fails, by how many, and whose names."""

from dataclasses import replace

import pytest

from syncrelay.status import Level, Phase
from syncrelay.status.as_document import status_of
from syncrelay.status.headline import headline
from tests.top import states

_WELL = status_of(states.healthy()).groups[0]
_STARTING = replace(_WELL, rate_hz=0.0, findings=tuple(replace(each, code="starting") for each in _WELL.findings))


def groups(*, ok=(), warn=(), error=(), few=(), starting=()):
    """Groups of these names."""
    of = {
        "ok": [replace(_WELL, name=name) for name in ok],
        "warn": [replace(_WELL, name=name, level=Level.WARN) for name in warn],
        "error": [replace(_WELL, name=name, level=Level.ERROR, rate_hz=0.0) for name in error],
        "few": [replace(_WELL, name=name, level=Level.ERROR) for name in few],
        "starting": [replace(_STARTING, name=name) for name in starting],
    }
    return [group for each in of.values() for group in each]


_MANY = [f"group_{number:02}" for number in range(29)]


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ({}, "no group is running yet"),
        ({"ok": ["front"]}, "the only group gives sets"),
        ({"ok": ["front", "rear"]}, "all 2 groups give sets"),
        ({"error": ["front"]}, "the only group fails: no sets from front"),
        ({"error": ["rear", "front"], "ok": ["left"]}, "2 of 3 groups fail: no sets from front and rear"),
        (
            {"error": [*"ecdabfghijk"], "ok": _MANY},
            "11 of 40 groups fail: no sets from a, b, c and 8 more",
        ),
        (
            {"error": ["front"], "few": ["rear"], "warn": ["left"], "ok": ["right"]},
            "2 of 4 groups fail: no sets from front, too few sets from rear; 1 other with a warning",
        ),
        ({"warn": ["rear"], "ok": ["front"]}, "1 of 2 groups has a warning: rear"),
        ({"warn": ["rear", "left"], "ok": ["front"]}, "2 of 3 groups have a warning: left and rear"),
        ({"starting": ["front", "rear"]}, "2 groups: 2 starting"),
        ({"starting": ["front"], "ok": ["rear"]}, "1 of 2 groups gives sets; 1 starting"),
    ],
)
def test_what_has_to_be_known_first_is_said_in_one_sentence(told, said):
    assert headline(Phase.RUNNING, groups(**told)) == said


@pytest.mark.parametrize("phase", [Phase.PAUSED, Phase.INACTIVE])
def test_that_the_relay_as_a_whole_gives_no_sets_is_said_before_all(phase):
    assert headline(phase, groups(warn=["front", "rear"])) == f"{phase.value}: no sets from all 2 groups"
