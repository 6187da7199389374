"""A relay that stands still for 3 s: only that is said, as long as data of that time is looked at."""

import signal
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.ros.stage import Stage
from tests.scenarios.play import BUSY, Played, Theatre, undisturbed
from tests.scenarios.rigs import WELL_IN_EACH_WAY

pytestmark = [pytest.mark.ros, pytest.mark.first, pytest.mark.timeout(1800)]

_STOPPED_S = 3
# What is measured of the last messages goes back so far.
_AFTER_S = 35


def test_only_the_wait_for_the_relay_is_said_and_then_all_is_well(tmp_path: Path):
    undisturbed(tmp_path, _play, _faults)


def _play(stage: Stage) -> Played:
    theatre = Theatre(stage, WELL_IN_EACH_WAY)
    watch, relay = theatre.watch, theatre.file.relay
    watch.wait(lambda: watch.are_well(WELL_IN_EACH_WAY))
    watch.begin("2")
    relay.send(signal.SIGSTOP)
    time.sleep(_STOPPED_S)  # that is the fault
    relay.send(signal.SIGCONT)
    watch.wait(lambda: watch.are_well(WELL_IN_EACH_WAY), least_s=_AFTER_S)
    return watch.played()


def _faults(played: Played) -> Iterator[str]:
    for name in WELL_IN_EACH_WAY:
        found = {code for code, each in played.shown[name]["2"].items() if each["severity"] != "ok"}
        if played.false_warnings(name, ()) or not found <= BUSY or played.problems_at_last(name):
            yield played.told(name)
    for name in ("by_stamps", "by_receipt", "beside_an_imu"):
        if "too_slow" not in played.shown[name]["2"] or not played.warnings_of(name):
            yield f"that the relay stood still is not said: {played.told(name)}"
