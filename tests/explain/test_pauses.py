"""A relay that is paused and goes on: that no set leaves has a reason, and nothing else is blamed, then or later."""

import pytest

from tests.explain.scenario import Source, run

_CAMERA, _LIDAR = Source("/camera", hz=30, jitter_ms=2), Source("/lidar", hz=10, jitter_ms=2)
_SLOP = {"slop": "60ms"}


def test_a_silence_that_begins_in_a_pause_is_told_after_it():
    dead = Source("/lidar", hz=10, sends=lambda second: second < 40)
    told = run(_CAMERA, dead, seconds=90, options=_SLOP, paused=[(20, 60)])
    silent = told.findings("silent")
    assert all(each.severity.name == ("WARN" if second < 65 else "ERROR") for second, each in silent)
    assert {line.code for line in told.warnings} == {"silent"}
    in_the_pause, *after = told.warnings
    assert in_the_pause.second >= 45
    assert all(line.second >= 65 for line in after)
    assert not any("recovered" in line.text for line in told.lines)


def test_a_pause_is_no_recovery_of_what_was_silent_before_it():
    gone = Source("/lidar", hz=10, sends=lambda second: not 20 < second < 80)
    told = run(_CAMERA, gone, seconds=120, options=_SLOP, paused=[(40, 60)])
    # It is over when the share of the last 10 s is what it was.
    assert [line.second for line in told.lines if "recovered" in line.text] == pytest.approx([90], abs=1)


def test_stamps_that_were_unset_before_a_pause_are_not_said_to_be_mended_by_it():
    unset = Source("/lidar", hz=10, stamp=lambda _: 0)
    told = run(_CAMERA, unset, seconds=90, options=_SLOP, paused=[(30, 60)])
    assert {line.code for line in told.lines} == {"unstamped"}
    assert not any("resolved" in line.text or "recovered" in line.text for line in told.lines)
