"""What a relay finds where DDS shows or hides something, which virtual time cannot play; see tests/bank too."""

import re
import signal
from typing import Any

import pytest

from tests.ros.cdr_messages import VECTOR, serialize
from tests.ros.processes import wait_until
from tests.ros.sensors import front, play, stream
from tests.ros.stage import Stage
from tests.ros.status import get, status

pytestmark = pytest.mark.ros


def test_messages_that_dds_lost_while_the_relay_stood_still_are_counted_and_the_relay_is_blamed(stage: Stage):
    # What a socket cannot hold is lost for certain, what shared memory cannot hold only sometimes.
    stage.environment["FASTDDS_BUILTIN_TRANSPORTS"] = "UDPv4"
    relay = stage.relay(front(slop="10s"))
    collector = stage.collector({"/camera": VECTOR}, reliability="best_effort")
    fast = stream("/camera", hz=50)

    def camera() -> dict[str, Any]:
        return next((group["inputs"][0] for group in status(relay)["groups"]), {"received": 0})

    big = serialize("std_msgs/msg/String", "x" * 10_000)
    play(stage, stream("/lidar", hz=10))
    play(stage, [frame._replace(payload=frame.payload + big) for frame in fast], reliability="best_effort")
    # What is lost in a publisher's first looks is what it sent before it was heard.
    wait_until(lambda: camera()["received"] > 200, "messages of four seconds")
    lost = camera()["lost"]
    relay.send(signal.SIGSTOP)
    sent = collector.count("/camera")
    collector.wait_for("/camera", sent + 100)
    relay.send(signal.SIGCONT)
    said: set[str] = set()

    def is_blamed() -> bool:
        nonlocal said
        (group,) = status(relay)["groups"]
        said = {each["code"] for each in group["findings"]}
        return "too_slow" in said and group["inputs"][0]["lost"] > lost

    wait_until(is_blamed, "a relay that is too slow, and losses that are counted")
    assert "messages_lost" not in said

    def is_counted() -> bool:
        """What DDS reports is taken a look later: it may be of a publisher that the graph does not show yet."""
        found = re.search(
            r'syncrelay_messages_lost_total\{group="front",topic="/camera"\} (\S+)', get(relay, "/metrics")
        )
        return found is not None and float(found[1]) > 0

    wait_until(is_counted, "the losses in the metrics")
