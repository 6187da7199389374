"""The rigs of tests/scenarios in virtual time, at moments that a busy machine may choose: the same is said of them."""

import pytest

from syncrelay.explain import Severity
from tests.explain.rig_play import Play, Played, played
from tests.explain.scenario import Line, Told
from tests.faults.extent import chosen
from tests.scenarios import rigs
from tests.scenarios.rigs import Scenario, offers_in_vain

RIGS = {**rigs.RIGS, **rigs.WELL_IN_EACH_WAY}
# At these seeds another cause was named once, or the true one without its cure. Of all other rigs, any will do.
SEEDS: dict[str, tuple[int, ...]] = {
    **dict.fromkeys(
        ("drift_of_1_percent", "drift_of_1000_ppm", "drift_of_200_ppm", "stamps_in_pairs"), tuple(range(6))
    ),
    "camera_halves": (1,),
    "late_camera": (0,),
    "all_in_batches": (2,),
    "never_near": (0, 1),
    "lidar_comes_late": (4,),
    "clock_steps_on": (1, 2),
    "camera_returns_best_effort": (0, 1),
    "camera_returns_as_points": (0,),
    # At these the relay stands still for 3 s.
    "by_stamps": (55,),
    "by_receipt": (62,),
    "beside_an_imu": (12,),
    "with_optional": (0,),
    "latest": (15,),
}
_SAID_TO_BE_SLOW = {"by_stamps", "by_receipt", "beside_an_imu"}
_OTHER_SEEDS = (100,)
_CASES = [(name, seed) for name in RIGS for seed in SEEDS.get(name, _OTHER_SEEDS)[: chosen(short=1, long=None)]]
# What goes on while a drift is not proven yet; the log does not say it.
_NOT_YET = "not known yet"


@pytest.mark.parametrize(("name", "seed"), _CASES)
@pytest.mark.long
def test_at_any_moment_the_cause_is_named_and_no_other(name: str, seed: int):
    rig = RIGS[name]
    play = played(name, rig, seed)
    allowed = {rig.first, *rig.also}
    assert not [line for line in play.told.warnings if not _is_true(play.play, line.code, line.second, allowed)]
    assert not _wrong_errors(play.play, play.told, allowed)
    assert not [line.text for line in play.told.warnings if offers_in_vain(line.text, rig)]
    if rig.first:
        first = _first_of_cause(play, rig)
        assert first.code == rig.first
        assert first.topics == {f"/{name}/{topic}" for topic in rig.about}, first
    if rig.first and rig.heals:
        _is_well_at_last(play)
    if name in _SAID_TO_BE_SLOW:
        assert "too_slow" in {line.code for line in play.told.warnings}


def _is_true(play: Play, code: str | None, second: float, allowed: set[str]) -> bool:
    is_of_machine = code == "too_slow" and not play.moments.is_smooth
    return code in allowed or is_of_machine or (code == "no_publisher" and play.is_missing_at(second))


def _wrong_errors(play: Play, told: Told, allowed: set[str]) -> list[tuple[float, str]]:
    errors = [(second, each) for second, found in told.found for each in found if each.severity is Severity.ERROR]
    return [
        (second, each.text)
        for second, each in errors
        if not _is_true(play, each.code.value, second, allowed) and _NOT_YET not in (each.suggestion or "")
    ]


def _first_of_cause(play: Played, rig: Scenario) -> Line:
    """The first warning but for what was truly so before: nobody published yet, or the machine was busy."""
    return next(
        line
        for line in play.told.warnings
        if line.code == rig.first or not _is_true(play.play, line.code, line.second, set())
    )


def _is_well_at_last(play: Played) -> None:
    told = play.told_cured or play.told
    if play.cured is not None:
        assert not [each for each in told.warnings if not _is_true(play.cured, each.code, each.second, set())]
    _, found = told.found[-1]
    assert {each.code.value for each in found if each.severity is not Severity.OK} <= {"too_slow"}
