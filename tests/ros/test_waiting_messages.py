"""Messages that wait for the relay: told of the groups that they are of, and of no other."""

import time
from threading import Event

import pytest

from syncrelay.config import load_text
from syncrelay.explain import Code
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs
from tests.ros.processes import DEADLINE_S, wait_until
from tests.ros.stage import Stage
from tests.ros.streams import at, merged

own_relay = pytest.importorskip("tests.ros.in_process", reason="rclpy is not installed").own_relay

pytestmark = pytest.mark.ros

_FRONT = dict.fromkeys(("/a", "/b"), VECTOR)
_REAR = dict.fromkeys(("/c", "/d"), VECTOR)
_FILE = config(
    {name: {"policy": "exact_time", "topics": inputs(topics)} for name, topics in (("front", _FRONT), ("rear", _REAR))},
    metrics=None,
)


def test_only_groups_whose_messages_waited_are_told_that_the_relay_is_too_slow(stage: Stage, monkeypatch):
    for name, value in stage.environment.items():
        monkeypatch.setenv(name, value)
    may_turn, is_held = Event(), Event()
    may_turn.set()

    def turn() -> None:
        if not may_turn.is_set():
            is_held.set()
            may_turn.wait(DEADLINE_S)

    player = stage.player(_FRONT | _REAR)
    with own_relay(load_text(_FILE), on_turn=turn) as relay:

        def sets_of(*counts: int) -> bool:
            relay.step(0)
            return [report.facts.figures.sets for report in relay.evaluate()] == list(counts)

        def told() -> dict[str, bool]:
            return {
                report.facts.name: any(finding.code is Code.TOO_SLOW for finding in report.findings)
                for report in relay.evaluate()
            }

        subscribed = relay.node.graph.subscribers_of
        wait_until(lambda: relay.step(0) or all(map(subscribed, _FRONT | _REAR)), "the subscriptions")
        player.match()
        player.play(merged(at("/a", 0), at("/b", 0), at("/c", 0), at("/d", 0)))
        wait_until(lambda: sets_of(1, 1), "a set of both groups")
        # On a busy machine they may have waited too.
        wait_until(lambda: told() == {"front": False, "rear": False}, "nothing that waited to be told")
        may_turn.clear()
        # A loop that still rests takes both messages before it comes to hold still.
        assert is_held.wait(DEADLINE_S)
        player.play(merged(at("/a", 10), at("/b", 10)))
        played = time.monotonic()
        wait_until(lambda: time.monotonic() > played + 0.7, "the messages to have waited")
        may_turn.set()
        wait_until(lambda: sets_of(2, 1), "the set that waited")
        assert told() == {"front": True, "rear": False}
