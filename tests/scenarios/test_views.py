"""The relay, `observe` and `doctor --live` look at the same rigs at the same time, and come to the same verdict."""

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.ros.configs import config
from tests.ros.processes import DEADLINE_S, wait_until
from tests.ros.sensors import observed_problems
from tests.ros.stage import Stage
from tests.ros.status import findings
from tests.scenarios.play import BUSY, Theatre
from tests.scenarios.rigs import RIGS, Scenario, group_of
from tests.scenarios.streams import Stream

pytestmark = [pytest.mark.ros, pytest.mark.timeout(600)]

_RIGS = {
    **{name: RIGS[name] for name in ("well", "well_with_map", "stamps_of_zero", "gps_time", "never_near", "elsewhere")},
    "camera_best_effort": Scenario(
        streams=[Stream("camera", 10, reliability="best_effort"), Stream("lidar", 10)],
        inputs={"camera": {"qos": {"reliability": "reliable"}}},
        first="incompatible_qos",
    ),
}
# Longer where a busy machine let one of them see too little.
_SECONDS = (12, 36, 72)


def test_all_views_come_to_the_same_verdict(stage: Stage):
    theatre = Theatre(stage, _RIGS)
    path = stage.folder / "looked-at.yaml"
    # The relay's own outputs are none of what is looked at.
    looked_at = {name: {**group_of(name, rig), "output_prefix": f"/looked_at/{name}"} for name, rig in _RIGS.items()}
    path.write_text(config(looked_at, node={"name": "looker"}))
    for seconds in _SECONDS:
        others = list(_other_verdicts(stage, path, seconds))
        if not others:
            break
    assert others == []
    for name, rig in _RIGS.items():
        code = rig.first or "healthy"
        wait_until(lambda name=name, code=code: code in findings(theatre.file.relay, name), f"{code} of {name}")


def _other_verdicts(stage: Stage, path: Path, seconds: int) -> Iterator[str]:
    """What `observe`, and a doctor that looks at the same time, say of a rig that is not what it is."""
    observe, doctor = (
        stage.start(words[0], [sys.executable, "-m", "syncrelay", *words, "--seconds", f"{seconds}", "--json"])
        for words in (["observe", "--config", str(path)], ["doctor", "--config", str(path), "--live"])
    )
    assert observe.wait(seconds + DEADLINE_S) == 1
    assert doctor.wait(seconds + DEADLINE_S) == 1
    observed, diagnoses = observed_problems(observe), json.loads(doctor.stdout)["diagnoses"]
    for name, rig in _RIGS.items():
        expected = {rig.first} - {""}
        # A diagnosis names the group, or one of its topics.
        about = [each for each in diagnoses if re.search(rf"(?<!\w){name}(?!\w)", json.dumps(each))]
        diagnosed = {each["code"] for each in about if each["severity"] != "info"}
        # What is truly so on a machine that is busy hides what it explains.
        if observed[name] != BUSY and observed[name] - BUSY != expected:
            yield f"{name}, observed: {observed[name]}"
        if diagnosed != BUSY and not (expected <= diagnosed and (rig.first or diagnosed <= BUSY)):
            yield f"{name}, diagnosed: {about}"
