"""What a relay says of broken rigs: the cause first, nothing that is not so, and what to write in the file to mend it.

All are groups of one relay, whose sensors play in real time; see tests.scenarios.play.
"""

import re

import pytest

from tests.ros.stage import Stage
from tests.scenarios import rigs_flow, rigs_graph, rigs_stamps
from tests.scenarios.play import Played
from tests.scenarios.play import play as play_scenarios
from tests.scenarios.told import false_warnings, told, was_busy

pytestmark = [pytest.mark.ros, pytest.mark.timeout(1800)]

RIGS = {**rigs_flow.RIGS, **rigs_stamps.RIGS, **rigs_graph.RIGS}


def play(stage: Stage) -> Played:
    return play_scenarios(stage, RIGS)


@pytest.mark.parametrize("name", [name for name, rig in RIGS.items() if rig.first])
def test_the_first_warning_names_the_cause(played: Played, name: str):
    first = next((line for line in played.warnings_of(name) if line.finding != "too_slow"), None)
    if first is None and played.warnings_of(name):
        pytest.skip(f"the machine gave the relay too little time to judge {name}")
    assert first is not None, told(played, name)
    assert first.finding == RIGS[name].first, told(played, name)
    assert re.search(RIGS[name].says, first.message), first.message


@pytest.mark.parametrize("name", RIGS)
def test_no_false_cause_is_named(played: Played, name: str):
    rig = RIGS[name]
    assert not false_warnings(played, name, rig.also | {rig.first}), told(played, name)
    if rig.never_says:
        said = [line.message for line in played.warnings_of(name) if re.search(rig.never_says, line.message)]
        assert not said


@pytest.mark.parametrize("name", [name for name, rig in RIGS.items() if rig.heals and rig.first])
def test_what_is_mended_is_well_again_and_stays_so(played: Played, name: str):
    if RIGS[name].cure:
        assert played.written[name], f"nothing to write was suggested: {told(played, name)}"
    # Where the machine holds messages up, some come too late for any figure that was measured before.
    well = {"healthy", "time_jump", *({RIGS[name].first, "too_slow"} if was_busy(played, "well") else ())}
    assert {finding["code"] for finding in played.last[name]["findings"]} <= well, told(played, name)
    if RIGS[name].cure:
        assert {line.finding for line in played.warnings_of(name) if line.act == "3"} <= well | {"too_slow"}
    assert played.last[name]["rate_hz"] > 0, told(played, name)


@pytest.mark.parametrize("name", [name for name, rig in RIGS.items() if rig.begins_well or not rig.first])
def test_a_rig_that_is_well_is_never_said_to_give_few_sets(played: Played, name: str):
    assert "few_sets" not in played.shown[name]["1"]


def test_a_cause_of_all_inputs_is_said_once(played: Played):
    for name in ("all_in_batches", "all_silent", "elsewhere"):
        # What is said again has other figures.
        said = [re.sub(r"[\d.]+", "N", line.message) for line in played.warnings_of(name) if line.finding != "too_slow"]
        assert len(set(said[:2])) == 1, told(played, name)


@pytest.mark.parametrize("name", [name for name, rig in RIGS.items() if rig.over])
def test_the_end_of_it_is_said(played: Played, name: str):
    said = [line.message for line in played.notes_of(name)]
    assert any(re.search(RIGS[name].over, message) for message in said), [told(played, name), said]


def test_an_offset_pairs_the_frames_that_belong_together(played: Played):
    assert played.last["lidar_stamped_late"]["span_ms"]["p50"] < 10


def test_a_recording_that_is_looped_is_no_fault(played: Played):
    assert "time_jump" in played.shown["looped"]["2"], told(played, "looped")
    assert played.last["looped"]["rate_hz"] > 0.8 * played.last["looped"]["possible_hz"]


def test_nothing_that_fell_is_blamed_where_two_publish(played: Played):
    assert "time_jump" not in played.shown["two_cameras"]["2"]


@pytest.mark.parametrize("name", ["gps_time", "time_since_boot", "clock_steps_on", "never_near", "lidar_80_ms_off"])
def test_no_queue_is_promised_to_hold_what_never_fits(played: Played, name: str):
    assert any(re.search(r": \d+ sets?$", line.message) for line in played.notes_of(name)), "no summary at the end"
    assert not [line.message for line in played.notes_of(name) if "queue_size" in line.message]
