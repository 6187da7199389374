"""A relay with nobody around it, and one that runs by a clock that nobody tells."""

import json
import re
import time

import pytest

from tests.ros.cdr_messages import CLOCK, VECTOR, serialize
from tests.ros.cdr_messages import time as ros_time
from tests.ros.configs import config, inputs
from tests.ros.frames import Frame
from tests.ros.processes import Process, wait_until
from tests.ros.sensors import APPROXIMATE, OF_A_BUSY_MACHINE, play
from tests.ros.stage import Stage
from tests.ros.status import ANY_PORT, findings
from tests.scenarios.play import Source
from tests.scenarios.streams import Stream

pytestmark = pytest.mark.ros


def _warned(relay: Process) -> list[tuple[str, str]]:
    """The finding and the message of each warning, in their order."""
    *lines, _ = relay.stderr.split("\n")
    said = [json.loads(line) for line in lines if line.startswith("{")]
    return [(line.get("finding", ""), line["message"]) for line in said if line["level"] in ("warning", "error")]


def test_a_relay_that_is_alone_says_so_and_nothing_of_each_topic(stage: Stage):
    topics = {
        "front": ["/front/camera", "/front/lidar"],
        "rear": ["/rear/camera", "/rear/lidar", "/rear/radar"],
    }
    groups = {name: {**APPROXIMATE, "topics": inputs(dict.fromkeys(each, VECTOR))} for name, each in topics.items()}
    relay = stage.relay(config(groups, metrics=ANY_PORT), "--log-format", "json")
    relay.wait_until(
        lambda: [code for code, _ in _warned(relay)].count("alone") >= len(topics), "a warning of each group"
    )
    assert {code for code, _ in _warned(relay)} - OF_A_BUSY_MACHINE == {"alone"}
    for message in [message for code, message in _warned(relay) if code == "alone"]:
        assert re.search(rf"domain {stage.domain}\b", message, re.IGNORECASE), message
        assert "LOCALHOST" in message
        assert "syncrelay doctor" in message
        assert "--live" in message
    source = Source(stage, [Stream(topic, 10) for each in topics.values() for topic in each])
    source.begin("1")
    for name in topics:
        wait_until(lambda name=name: "healthy" in findings(relay, name), f"sets of {name}")
    assert {code for code, _ in _warned(relay)} <= {"alone"} | OF_A_BUSY_MACHINE


def test_a_clock_that_nobody_tells_is_said_and_nothing_that_hangs_on_it(stage: Stage):
    topics = [*inputs({"/camera": VECTOR, "/lidar": VECTOR}), *inputs({"/radar": VECTOR}, required=False)]
    group = {**APPROXIMATE, "max_wait": "100ms", "topics": topics}
    relay = stage.relay(config({"front": group}, metrics=ANY_PORT, node={"use_sim_time": True}), "--log-format", "json")
    radar = Stream("/radar", 10, late_ms=40)
    Source(stage, [Stream("/camera", 10), Stream("/lidar", 10), radar]).begin("1")
    relay.wait_until(lambda: "no_clock" in dict(_warned(relay)), "a warning")
    wait_until(lambda: "no_clock" in findings(relay), "the finding")
    shown = findings(relay)
    begin = time.time_ns()
    ticks = [begin + n * 50_000_000 for n in range(2400)]
    play(stage, [Frame("/clock", CLOCK, tick, serialize(CLOCK, ros_time(tick))) for tick in ticks])
    said = _warned(relay)
    assert {code for code, _ in said} - OF_A_BUSY_MACHINE == {"no_clock"}, said
    of_clock = [message for code, message in said if code == "no_clock"]
    assert all(re.search(r"no /clock (message )?has been received", message) for message in of_clock), said
    findings_shown = [each for code, each in shown.items() if code not in OF_A_BUSY_MACHINE]
    told = of_clock + [f"{each['text']} {each['suggestion']}" for each in findings_shown]
    assert not [each for each in told if re.search(r"max_wait|stood still|year|\d{6,} s", each)]
    wait_until(lambda: "no_clock" not in findings(relay), "the finding to be over")
    wait_until(lambda: not {"no_clock", "clock_stopped", "starting"} & findings(relay).keys(), "sets")
