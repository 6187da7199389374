"""A network that loses, throttles and breaks between sensors and relay: fewer sets, no wrong one, and told why."""

import json
import re
import subprocess
import time
from collections.abc import Iterator
from operator import eq, sub
from typing import Any

import pytest

from tests.faults.extent import chosen
from tests.faults.flow import WAYS, Rig, Source, Witness, go_way
from tests.faults.networks import Cable, two_machines, why_not
from tests.ros.processes import Process, wait_until
from tests.ros.stage import Stage
from tests.ros.status import address

pytestmark = [pytest.mark.ros, pytest.mark.faults]

_HZ = 100
_FAULT_S = chosen(short=2, long=20)
_CUT_S = chosen(short=2, long=10)
# Packets that are lost; with fast heartbeats hardly anything comes of it.
_TOLD = {"reliable": "bursts", "best_effort": "messages_lost"}
_GET = "import sys, urllib.request; print(urllib.request.urlopen(sys.argv[1], timeout=90).read().decode())"


@pytest.fixture
def cable() -> Iterator[Cable]:
    if reason := why_not():
        pytest.skip(reason)
    with two_machines() as made:
        yield made


class _Scene:
    """A source on one machine, a relay and a witness on the other."""

    def __init__(self, stage: Stage, cable: Cable, reliability: str) -> None:
        stage.environment |= {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}
        there = Rig(stage, before=tuple(cable.enter(cable.first)))
        here = Rig(stage, before=tuple(cable.enter(cable.second)))
        self.cable = cable
        self.relay: Process = here.relay()
        self.witness: Witness = here.witness(reliability=reliability)
        self.source: Source = there.source(reliability=reliability)
        self.source.match()
        self.source.pace(_HZ)
        self.witness.wait_for_sets(_HZ)

    def _get(self, page: str) -> str:
        """A page of the relay's, asked for on its machine."""
        words = [*self.cable.enter(self.cable.second), "python3", "-c", _GET, f"{address(self.relay)}{page}"]
        return subprocess.run(words, check=True, capture_output=True, text=True).stdout

    def counts(self, *of: str) -> list[float]:
        """How many messages of all inputs were `sent`, `delivered` or `received`, by the metrics at one moment."""
        page = self._get("/metrics")
        found = [re.findall(rf"^syncrelay_messages_{what}_total{{.*}} (.*)$", page, re.MULTILINE) for what in of]
        return [sum(map(float, each)) for each in found]

    def state(self) -> dict[str, Any]:
        """The group as /status has it."""
        (group,) = json.loads(self._get("/status"))["groups"]
        for each in group["inputs"]:
            assert each["received"] == each["matched"] + sum(each["dropped"].values()) + each["buffered"]
        return dict(group)

    def codes(self) -> set[str]:
        return {finding["code"] for finding in self.state()["findings"]}

    def run(self, seconds: float) -> float:
        """Let so much time pass; how many sets a second came meanwhile."""
        before, began = self.witness.report().sets, time.monotonic()
        self.relay.wait_until(lambda: time.monotonic() >= began + seconds, "its time")
        return (self.witness.report().sets - before) / (time.monotonic() - began)

    def recover(self) -> float:
        """Wait until sets come that are newer than now; how long that takes, in seconds."""
        now = time.time_ns()
        self.witness.wait_for_set_after(now)
        assert self.witness.report().faults == []
        return (time.time_ns() - now) / 1e9


@pytest.mark.timeout(600)
@pytest.mark.parametrize("way", chosen(short=[WAYS[0], WAYS[-1]], long=WAYS))
def test_a_network_that_loses_throttles_and_breaks(stage: Stage, cable: Cable, way: str, figures):
    reliability = go_way(stage, way)
    scene = _Scene(stage, cable, reliability)
    cable.lose(0.1)
    before = scene.counts("sent", "delivered")
    lossy_hz = scene.run(_FAULT_S)
    if way in _TOLD:
        wait_until(lambda: _TOLD[way] in scene.codes(), "the loss to be told")
    sent, delivered = map(sub, scene.counts("sent", "delivered"), before)
    cable.lose_no_more()
    after_loss_s = scene.recover()
    # Of 100 messages a second of two topics, each of some 150 bytes on the wire, less than half comes through.
    cable.throttle("100kbit")
    throttled_hz = scene.run(_FAULT_S)
    cable.throttle_no_more()
    after_throttling_s = scene.recover()
    cable.cut()
    cut_hz = scene.run(_CUT_S)
    told = scene.codes()
    cable.mend()
    after_cut_s = scene.recover()
    assert scene.state()["sets"] > 0
    # A busy machine loses more than the network does.
    assert way != "best_effort" or (sent - delivered) / sent > 0.03
    published = sum(scene.source.pace(0))
    wait_until(lambda: eq(*scene.counts("delivered", "received")), "counts that agree")
    assert scene.counts("sent") <= [published]
    figures(
        f"network ({way}): 10 % lost: {lossy_hz:.0f} of {_HZ} sets a second; throttled to 100 kbit/s:"
        f" {throttled_hz:.0f}; cut for {_CUT_S} s: {cut_hz:.0f}, told as {', '.join(sorted(told))}; new sets"
        f" {after_loss_s:.1f}, {after_throttling_s:.1f} and {after_cut_s:.1f} s after each; none wrong"
    )
