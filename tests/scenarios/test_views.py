"""The relay, `observe` and `doctor --live` look at the same rigs at the same time, and come to the same verdict."""

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.ros.configs import config
from tests.ros.processes import DEADLINE_S, wait_until
from tests.ros.sensors import observed_codes
from tests.ros.stage import Stage
from tests.ros.status import findings
from tests.scenarios import rigs_flow, rigs_graph, rigs_stamps
from tests.scenarios.play import Scenario, Theatre, group_of
from tests.scenarios.streams import Stream

pytestmark = [pytest.mark.ros, pytest.mark.timeout(600)]

_WELL = {"well": rigs_flow.RIGS["well"], "well_with_map": rigs_flow.RIGS["well_with_map"]}
_BROKEN = {
    "stamps_of_zero": rigs_stamps.RIGS["stamps_of_zero"],
    "gps_time": rigs_stamps.RIGS["gps_time"],
    "never_near": rigs_stamps.RIGS["never_near"],
    "elsewhere": rigs_graph.RIGS["elsewhere"],
    "camera_best_effort": Scenario(
        streams=[Stream("camera", 10, reliability="best_effort"), Stream("lidar", 10)],
        inputs={"camera": {"qos": {"reliability": "reliable"}}},
        first="incompatible_qos",
    ),
}
_RIGS = {**_WELL, **_BROKEN}
# What else is truly so for a while on a machine that is busy, whoever looks; said alone, it hides what it explains.
_BUSY = {"too_slow"}
# Longer where a busy machine let one of them see too little.
_SECONDS = (12, 36, 72)


def test_all_views_come_to_the_same_verdict(stage: Stage):
    theatre = Theatre(stage, _RIGS)
    path = stage.folder / "looked-at.yaml"
    # The relay's own outputs are none of what is looked at.
    looked_at = {name: {**group_of(name, rig), "output_prefix": f"/looked_at/{name}"} for name, rig in _RIGS.items()}
    path.write_text(config(looked_at, node={"name": "looker"}))
    for seconds in _SECONDS:
        observed, diagnoses = _looked(stage, path, seconds)
        others = [*_verdicts_of_others(observed), *_diagnoses_of_others(diagnoses)]
        if not others:
            break
    assert others == []
    for name, rig in _RIGS.items():
        code = rig.first or "healthy"
        wait_until(lambda name=name, code=code: code in findings(theatre.file.relay, name), f"{code} of {name}")


def _looked(stage: Stage, path: Path, seconds: int) -> tuple[dict[str, set[str]], list[dict[str, Any]]]:
    """The codes of what `observe` finds of each group, and the diagnoses of a doctor that looks at the same time."""
    syncrelay = [sys.executable, "-m", "syncrelay"]
    observe = stage.start(
        "observe", [*syncrelay, "observe", "--config", str(path), "--seconds", f"{seconds}", "--json"]
    )
    live = ["--live", "--seconds", f"{seconds}", "--json"]
    doctor = stage.start("doctor", [*syncrelay, "doctor", "--config", str(path), *live])
    assert observe.wait(seconds + DEADLINE_S) == 1
    assert doctor.wait(seconds + DEADLINE_S) == 1
    return observed_codes(observe), list(json.loads(doctor.stdout)["diagnoses"])


def _verdicts_of_others(observed: dict[str, set[str]]) -> Iterator[str]:
    """What is said of a rig that is not what it is."""
    for name, rig in _RIGS.items():
        said = observed.get(name, set())
        if said != _BUSY and said - _BUSY != {rig.first or "healthy"}:
            yield f"{name}, observed: {said}"


def _diagnoses_of_others(diagnoses: list[dict[str, Any]]) -> Iterator[str]:
    for name, rig in _BROKEN.items():
        said = {each["code"] for each in diagnoses if _is_about(each, name)}
        if said != _BUSY and rig.first not in said:
            yield f"{name}, diagnosed: {diagnoses}"
    for name in _WELL:
        for each in diagnoses:
            if _is_about(each, name) and each["code"] not in _BUSY:
                yield f"{name}, diagnosed: {each}"


def _is_about(diagnosis: dict[str, Any], group: str) -> bool:
    """Whether it names the group or one of its topics."""
    return re.search(rf"(?<!\w){group}(?!\w)", json.dumps(diagnosis)) is not None
