"""What a relay says of broken rigs: the cause first, nothing that is not so, and what to write in the file to mend it.

All are groups of one relay, whose sensors play in real time; see tests.scenarios.play.
"""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.scenarios import rigs
from tests.scenarios.play import BUSY, Played, play, undisturbed
from tests.scenarios.rigs import Scenario, offers_in_vain

pytestmark = [pytest.mark.ros, pytest.mark.first, pytest.mark.timeout(1800)]

RIGS = {name: rig for name, rig in rigs.RIGS.items() if rig.over_dds}
# A machine that leaves a well rig's sets waiting for longer than this holds up all others as well.
_BUSY_MS = 40


def test_the_cause_is_named_and_no_other_and_what_is_suggested_mends_it(tmp_path: Path):
    undisturbed(tmp_path, lambda stage: play(stage, RIGS), _faults)


def _faults(played: Played) -> Iterator[str]:
    was_busy = played.last["well"]["latency_ms"]["p95"] > _BUSY_MS
    for name, rig in RIGS.items():
        found = [*_not_said(played, name, rig), *_said_wrongly(played, name, rig)]
        if rig.first and rig.heals:
            found += _not_mended(played, name, rig, {rig.first} | BUSY if was_busy else set())
        if found:
            yield "\n".join([*found, played.told(name)])
    # What is said again has other figures.
    for name in ("all_in_batches", "all_silent", "elsewhere"):
        said = [re.sub(r"[\d.]+", "N", line.message) for line in played.false_warnings(name, ())]
        if len(set(said[:2])) != 1:
            yield f"not said once, as a cause of all inputs is: {played.told(name)}"
    if not [line for line in played.lines if line.group == "all_silent" and not line.warns and line.act == "3"]:
        yield "the end of a silence is not noted"
    if played.last["lidar_stamped_late"]["span_ms"]["p50"] >= 10:
        yield "the offset does not pair the frames that belong together"
    if "time_jump" not in played.shown["looped"]["2"]:
        yield f"the loop was not seen: {played.told('looped')}"


def _not_said(played: Played, name: str, rig: Scenario) -> Iterator[str]:
    first = next(iter(played.false_warnings(name, ())), None)
    if rig.first and (first is None or first.finding != rig.first):
        yield f"{rig.first} is not said first"
    elif rig.first:
        finding = next(found[rig.first] for found in played.shown[name].values() if rig.first in found)
        if set(finding["topics"]) != {f"/{name}/{topic}" for topic in rig.about}:
            yield f"{rig.first} is about {finding['topics']}"


def _said_wrongly(played: Played, name: str, rig: Scenario) -> Iterator[str]:
    for line in played.false_warnings(name, rig.also | {rig.first}):
        yield f"false cause: {line.finding}"
    for line in played.warnings_of(name):
        if offers_in_vain(line.message, rig):
            yield f"offered in vain: {line.message}"
    if (rig.begins_well or not rig.first) and "few_sets" in played.shown[name]["1"]:
        yield "few_sets before anything is broken"


def _not_mended(played: Played, name: str, rig: Scenario, allowed: set[str]) -> Iterator[str]:
    if rig.cure and not played.written[name]:
        yield "nothing to write was suggested"
    if rig.cure and any(line.act == "3" for line in played.false_warnings(name, {rig.first})):
        yield "a warning of what is mended"
    if not played.problems_at_last(name) <= allowed or not played.last[name]["rate_hz"]:
        yield "it is not well at last"
