"""Worlds by seed keep their promises, and a world that is broken on purpose does not."""

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from syncrelay.dataflow.group import GroupRelay
from syncrelay.dataflow.inbox import Backlog
from syncrelay.relay.inputs import TopicInput
from tests.faults.extent import chosen
from tests.simulated.play import play, shrunk, world_of

pytestmark = pytest.mark.long


@pytest.mark.parametrize("first", range(0, 12, 3))
def test_worlds_keep_their_promises(first):
    for seed in range(first, first + chosen(short=3, long=500)):
        played = play(world_of(seed))
        assert not played.broken, f"seed {seed}\n{played.plan.described()}\n" + "\n".join(played.broken)


def test_the_same_seed_gives_the_same_log():
    one, other = (play(world_of(5)) for _ in range(2))
    assert one.lines == other.lines
    assert one.lines != play(world_of(6)).lines


def test_a_fault_of_the_relay_breaks_a_promise_and_the_world_is_made_smaller(monkeypatch):
    monkeypatch.setattr(GroupRelay, "flush", lambda *_: None)
    plan = world_of(next(seed for seed in range(100) if len(world_of(seed).groups) > 1))
    small = shrunk(plan, tries=8)
    assert "does not add up" in small.broken[0]
    assert len(small.plan.steps) + len(small.plan.groups) < len(plan.steps) + len(plan.groups)


def test_a_relay_that_polls_without_end_is_told(monkeypatch):
    monkeypatch.setattr(Backlog, "deliver", lambda *_: None)
    assert any("turns at one instant, now of syncrelay-receive" in broken for broken in play(world_of(4)).broken)


def test_a_refusal_that_is_never_tried_again_is_seen(monkeypatch):
    monkeypatch.setattr(TopicInput, "poll", lambda _: None)
    # Not all worlds refuse something.
    assert any("no set of message" in broken for seed in range(20) for broken in play(world_of(seed)).broken)
