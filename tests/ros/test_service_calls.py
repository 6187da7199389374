"""Calls of the relay's services that come to nothing: each is answered, and keeps away no other."""

from concurrent.futures import Future
from threading import Event

import pytest

from syncrelay.config import load_text
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs
from tests.ros.stage import Stage

own_relay = pytest.importorskip("tests.ros.in_process", reason="rclpy is not installed").own_relay

pytestmark = pytest.mark.ros

_FILE = config({"front": {"policy": "exact_time", "topics": inputs(dict.fromkeys(("/a", "/b"), VECTOR))}}, metrics=None)
_MOST = 10


def test_what_fails_and_what_never_ends_is_answered_and_more_calls_than_can_wait_are_refused(stage: Stage, monkeypatch):
    for name, value in stage.environment.items():
        monkeypatch.setenv(name, value)
    asked: list[Future[str]] = []
    all_wait = Event()

    def never() -> Future[str]:
        asked.append(Future())
        if len(asked) == _MOST:
            all_wait.set()
        return asked[-1]

    def broken() -> Future[str]:
        raise ZeroDivisionError("x")

    def hostile() -> Future[str]:
        told: Future[str] = Future()
        told.set_result("one\x1b[2J\ntwo\udc80")
        return told

    caller = stage.caller()
    with own_relay(load_text(_FILE)) as relay:
        relay.offer({"never": never, "broken": broken, "hostile": hostile})
        success, why = caller.call("broken")
        assert (success, "ZeroDivisionError('x')" in why) == (False, True)
        assert caller.call("hostile") == (True, "one\\x1b[2J\n  two\\udc80")
        for _ in range(_MOST):
            caller.begin("never")
            assert caller.get("groups") == [["front"]]
        assert all_wait.wait(60)
        assert caller.call("never") == (False, "10 calls are already waiting for their answers; call again later")
        relay.drain()
        assert caller.end() == [(False, "the relay is ending")] * _MOST
