"""The page at the root of a real relay over DDS, in a real Chromium."""

import signal

import pytest

from tests.browser import launched, needs_chromium, opened
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs
from tests.ros.sensors import stream
from tests.ros.stage import Stage
from tests.ros.status import ANY_PORT, address
from tests.ros.streams import merged

pytestmark = [pytest.mark.ros, needs_chromium]

PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
GROUPS = {
    "front": {"policy": "approximate_time", "slop": "20ms", "topics": inputs(PAIR)},
    "rear": {"policy": "exact_time", "topics": inputs({"/camera": VECTOR, "/rear": VECTOR})},
}


def test_its_sets_and_what_is_wrong_are_shown_until_it_ends(stage: Stage):
    relay = stage.relay(config(GROUPS, metrics=ANY_PORT))
    player = stage.player(PAIR)
    player.match()
    player.start(merged(stream("/camera", hz=10), stream("/lidar", hz=10, shift_ms=7)), speed=1)
    with launched() as browser, opened(browser) as opened_page:
        page = opened_page.page
        page.goto(f"{address(relay)}/#front")
        page.wait_for_selector("#group .lanes .set3 .joint", state="attached")
        assert page.locator("#groups strong").all_text_contents() == ["front", "rear"]
        page.keyboard.press("j")
        page.wait_for_selector("#group .note:has-text('nobody publishes /rear')")
        relay.send(signal.SIGTERM)
        page.wait_for_selector("#trouble:has-text('STALE')")
        # Chromium says that nothing answers any more.
        assert [each for each in opened_page.complaints if "net::ERR_" not in each] == []
