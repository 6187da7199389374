"""The relay, `observe` and `doctor --live` look at the same rigs at the same time, and come to the same verdict."""

import json
import re
import sys
from collections.abc import Iterator
from itertools import takewhile
from pathlib import Path

import pytest

from tests.ros.cdr_messages import VECTOR, vector
from tests.ros.configs import config, inputs
from tests.ros.frames import Frame
from tests.ros.processes import DEADLINE_S, wait_until
from tests.ros.sensors import APPROXIMATE, OF_A_BUSY_MACHINE, ON_AND_ON_MS, observed_problems, play, stream, warnings_of
from tests.ros.stage import Stage
from tests.ros.status import ANY_PORT, findings, wait_for_finding
from tests.ros.streams import BEGIN, merged
from tests.scenarios.rigs import RIGS, Scenario, group_of, placed
from tests.scenarios.streams import Sampler, Stream

pytestmark = [pytest.mark.ros, pytest.mark.timeout(600)]

_RIGS = {
    **{name: RIGS[name] for name in ("well", "well_with_map", "stamps_of_zero", "gps_time", "never_near", "elsewhere")},
    "camera_best_effort": Scenario(
        streams=[Stream("camera", 10, reliability="best_effort"), Stream("lidar", 10)],
        inputs={"camera": {"qos": {"reliability": "reliable"}}},
        first="incompatible_qos",
    ),
}
_GROUPS = {name: group_of(name, rig) for name, rig in _RIGS.items()}
_BUSY = {"too_slow"}
"""What a machine that gives a relay too little time makes of it, truly: no test has a say in that."""
# Longer where a busy machine let one of them see too little.
_SECONDS = (12, 36, 72)


def test_all_views_come_to_the_same_verdict(stage: Stage):
    _play_rigs(stage)
    relay = stage.relay(config(_GROUPS, metrics=ANY_PORT))
    path = stage.folder / "looked-at.yaml"
    # The relay's own outputs are none of what is looked at.
    looked_at = {name: {**group, "output_prefix": f"/looked_at/{name}"} for name, group in _GROUPS.items()}
    path.write_text(config(looked_at, node={"name": "looker"}))
    for seconds in _SECONDS:
        others = list(_other_verdicts(stage, path, seconds))
        if not others:
            break
    assert others == []
    for name, rig in _RIGS.items():
        code = rig.first or "healthy"
        wait_until(lambda name=name, code=code: code in findings(relay, name), f"{code} of {name}")


def _play_rigs(stage: Stage) -> None:
    """Have a node for each QoS send what the sensors of all rigs send."""
    streams = [stream for name, rig in _RIGS.items() for stream in placed(name, rig.streams)]
    for reliability, durability in {(each.reliability, each.durability) for each in streams}:
        alike = [each for each in streams if (each.reliability, each.durability) == (reliability, durability)]
        topics = dict.fromkeys((each.topic for each in alike), VECTOR)
        player = stage.player(topics, node=f"driver_{len(alike)}", reliability=reliability, durability=durability)
        player.is_up()
        player.start(merged(*map(_frames, alike)), speed=1)


def _frames(stream: Stream) -> list[Frame]:
    sampler = Sampler(stream)
    samples = takewhile(lambda each: each[0] < ON_AND_ON_MS / 1000, iter(sampler.next, None))
    return [
        Frame(
            stream.topic,
            VECTOR,
            BEGIN + round(sent * 1e9),
            vector(0 if stream.clock == "zero" else BEGIN + round(stamp * 1e9)),
        )
        for sent, _, stamp in samples
    ]


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
        if observed[name] != _BUSY and observed[name] - _BUSY != expected:
            yield f"{name}, observed: {observed[name]}"
        if diagnosed != _BUSY and not (expected <= diagnosed and (rig.first or diagnosed <= _BUSY)):
            yield f"{name}, diagnosed: {about}"


def test_a_relay_that_is_alone_says_so_and_nothing_of_each_topic(stage: Stage):
    topics = {"front": ["/front/camera", "/front/lidar"], "rear": ["/rear/camera", "/rear/lidar", "/rear/radar"]}
    groups = {name: {**APPROXIMATE, "topics": inputs(dict.fromkeys(each, VECTOR))} for name, each in topics.items()}
    relay = stage.relay(config(groups, metrics=ANY_PORT), "--log-format", "json")
    for name in topics:
        wait_for_finding(relay, "alone", name, naming=[f"{stage.domain}", "LOCALHOST", "`syncrelay doctor"])
    relay.wait_until(lambda: bool(warnings_of(relay, "front")), "a warning")
    play(stage, merged(*(stream(topic, hz=10) for each in topics.values() for topic in each)))
    for name in topics:
        wait_until(lambda name=name: "healthy" in findings(relay, name), f"sets of {name}")
        said = {line.get("finding", "") for line in warnings_of(relay, name)}
        assert {"alone"} <= said <= {"alone"} | OF_A_BUSY_MACHINE
