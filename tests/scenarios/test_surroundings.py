"""A relay with nobody around it, and one that runs by a clock that nobody tells."""

import json
from time import monotonic

import pytest

from tests.ros.cdr_messages import CLOCK, VECTOR, serialize, time
from tests.ros.configs import config, inputs
from tests.ros.frames import Frame
from tests.ros.processes import Process, wait_until
from tests.ros.sensors import APPROXIMATE, OF_A_BUSY_MACHINE, play, stream
from tests.ros.stage import Stage
from tests.ros.status import ANY_PORT, findings, problems, wait_for_finding
from tests.ros.streams import BEGIN, MS, merged

pytestmark = pytest.mark.ros


def _warned(relay: Process) -> dict[str, str]:
    """The last message of each finding that the log warned of."""
    *lines, _ = relay.stderr.split("\n")
    said = [json.loads(line) for line in lines if line.startswith("{")]
    return {line.get("finding", ""): line["message"] for line in said if line["level"] in ("warning", "error")}


def test_a_relay_that_is_alone_says_so_and_nothing_of_each_topic(stage: Stage):
    topics = {
        "front": ["/front/camera", "/front/lidar"],
        "rear": ["/rear/camera", "/rear/lidar", "/rear/radar"],
    }
    groups = {name: {**APPROXIMATE, "topics": inputs(dict.fromkeys(each, VECTOR))} for name, each in topics.items()}
    relay = stage.relay(config(groups, metrics=ANY_PORT), "--log-format", "json")
    relay.wait_until(lambda: "alone" in _warned(relay), "a warning")
    for name in topics:
        wait_for_finding(relay, "alone", name, naming=[f"{stage.domain}", "LOCALHOST", "`syncrelay doctor"])
    play(stage, merged(*(stream(topic, hz=10) for each in topics.values() for topic in each)))
    for name in topics:
        wait_until(lambda name=name: "healthy" in findings(relay, name), f"sets of {name}")
    assert _warned(relay).keys() <= {"alone"} | OF_A_BUSY_MACHINE


def test_a_clock_that_nobody_tells_is_said_and_nothing_that_hangs_on_it(stage: Stage):
    topics = [*inputs({"/camera": VECTOR, "/lidar": VECTOR}), *inputs({"/radar": VECTOR}, required=False)]
    group = {**APPROXIMATE, "max_wait": "100ms", "topics": topics}
    relay = stage.relay(config({"front": group}, metrics=ANY_PORT, node={"use_sim_time": True}), "--log-format", "json")
    play(stage, merged(stream("/camera", hz=10), stream("/lidar", hz=10), stream("/radar", hz=10, late_ms=40)))
    began = monotonic()
    relay.wait_until(lambda: "no_clock" in _warned(relay), "a warning")
    wait_until(lambda: problems(relay) - OF_A_BUSY_MACHINE == {"no_clock"}, "the finding alone")
    now = BEGIN + round((monotonic() - began) * 1e9)
    ticks = range(now, now + 120_000 * MS, 50 * MS)
    play(stage, [Frame("/clock", CLOCK, tick, serialize(CLOCK, time(tick))) for tick in ticks])
    wait_until(lambda: not {"no_clock", "clock_stopped", "starting"} & findings(relay).keys(), "sets")
    assert _warned(relay).keys() - OF_A_BUSY_MACHINE == {"no_clock"}
