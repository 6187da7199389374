"""`syncrelay top` and a real relay over DDS, each a process."""

import asyncio
import re
import signal
import sys

import pytest

from syncrelay.top.app import TopApp
from syncrelay.top.client import ask
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs
from tests.ros.processes import DEADLINE_S, wait_until
from tests.ros.sensors import stream
from tests.ros.stage import Stage
from tests.ros.status import ANY_PORT, address, wait_for_finding
from tests.ros.streams import merged
from tests.top.terminal import Terminal

pytestmark = pytest.mark.ros

PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
GROUPS = {
    "front": {"policy": "approximate_time", "slop": "20ms", "topics": inputs(PAIR)},
    "rear": {"policy": "exact_time", "topics": inputs({"/camera": VECTOR, "/rear": VECTOR})},
}


def once(stage: Stage, *words: str) -> tuple[int, str, str]:
    top = stage.start("top", [sys.executable, "-m", "syncrelay", "top", "--once", *words])
    return top.wait(), " ".join(top.stdout.split()), top.stderr


def test_its_groups_are_printed_once_and_the_screen_shows_them_until_it_ends(stage: Stage):
    relay = stage.relay(config(GROUPS, metrics=ANY_PORT))
    player = stage.player(PAIR)
    player.match()
    player.start(merged(stream("/camera", hz=10), stream("/lidar", hz=10, shift_ms=7)), speed=1)
    wait_for_finding(relay, "no_publisher", "rear")
    code, shown, talk = -1, "", ""
    relay.wait_for_log(f"watch with `syncrelay top --url {address(relay)}`")

    def is_in_order() -> bool:
        """On a busy machine it is something else now and then, or gives no answer in time, or is not yet measured."""
        nonlocal code, shown, talk
        code, shown, talk = once(stage, "--url", address(relay))
        return "front: OK" in shown and re.search(r"/camera: [\d.]+ Hz, lag ", shown) is not None

    wait_until(is_in_order, "a group in order whose input is measured")
    assert (code, talk) == (0, "")
    assert f"/syncrelay at {address(relay)}: running, not ready" in shown
    assert "nobody publishes /rear (geometry_msgs/msg/Vector3Stamped)" in shown

    async def look() -> None:
        app = TopApp([ask(address(relay), timeout_s=DEADLINE_S, whole_s=DEADLINE_S)])
        async with app.run_test(size=(80, 24)) as pilot:
            user = Terminal(app, pilot)
            await user.sees("front", deadline_s=DEADLINE_S)
            await user.press("enter")
            await user.sees("span in ms", deadline_s=DEADLINE_S)
            relay.send(signal.SIGTERM)
            await user.sees(" STALE: no answer for ", deadline_s=DEADLINE_S)
            assert "span in ms" in user.text

    asyncio.run(look())
    assert relay.wait() == 0
