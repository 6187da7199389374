"""The relay as a managed node, driven as nav2's lifecycle manager drives it."""

import itertools
import json
import random
import signal
import sys
from collections.abc import Iterator
from typing import Any

import pytest

from tests import preloaded
from tests.ros.cdr_messages import STRING, VECTOR, stamps_of
from tests.ros.configs import LOSSLESS, ROOMY, config, inputs
from tests.ros.frames import Frame
from tests.ros.processes import Process, wait_until
from tests.ros.stage import Collector, Player, Stage, both_backends
from tests.ros.status import ANY_PORT, first_group, page, problems, status
from tests.ros.streams import BEGIN, MS, at, merged
from tests.ros.summary import read_summary

pytest.importorskip("rclpy", reason="rclpy is not installed")

from lifecycle_msgs.msg import Transition, TransitionEvent
from lifecycle_msgs.srv import ChangeState, GetAvailableStates, GetAvailableTransitions, GetState

pytestmark = pytest.mark.ros

_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
_PAIR_OUT = {"/front/camera": VECTOR, "/front/lidar": VECTOR}
_FRONT = {"policy": "exact_time", "queue_size": ROOMY, "topics": inputs(_PAIR, qos=LOSSLESS)}


def _managed(node: dict[str, Any] | None = None, **groups: Any) -> str:
    return config(groups or {"front": _FRONT}, node={"lifecycle": True, **(node or {})}, metrics=ANY_PORT)


class _Manager:
    """Asks for transitions of one node, as nav2's lifecycle manager does."""

    def __init__(self, stage: Stage, node: str = "/syncrelay") -> None:
        self._caller = stage.caller(node)
        self._goals: list[str] = []

    def change(self, transition: str) -> bool:
        """Ask for a transition by its label, or its number; whether it succeeded."""
        asked = {"id": int(transition)} if transition.isdigit() else {"label": transition}
        return bool(self._caller.ask(ChangeState, "change_state", transition=Transition(**asked)).success)

    @property
    def state(self) -> str:
        return str(self._caller.ask(GetState, "get_state").current_state.label)

    @property
    def states(self) -> set[str]:
        """The labels of all states."""
        states = self._caller.ask(GetAvailableStates, "get_available_states").available_states
        return {each.label for each in states}

    def transitions(self, service: str) -> list[str]:
        """The labels of those that a service names."""
        return [
            each.transition.label for each in self._caller.ask(GetAvailableTransitions, service).available_transitions
        ]

    def watch(self) -> None:
        """Listen to the node's transition events from here on."""
        node, topic = self._caller.node, f"{self._caller.called}/transition_event"
        node.create_subscription(TransitionEvent, topic, lambda event: self._goals.append(event.goal_state.label), 100)
        wait_until(lambda: node.count_publishers(topic) > 0, f"a publisher of {topic}")

    def goals(self) -> list[str]:
        """Where the events led that were heard."""
        self._caller.spin()
        return self._goals


def _end(relay: Process, number: signal.Signals = signal.SIGTERM) -> None:
    relay.send(number)
    assert relay.wait() == 0
    assert "Traceback" not in relay.stderr


def _pairs(start_ms: int) -> Iterator[list[Frame]]:
    """One set after the other, a millisecond apart."""
    return (merged(at("/camera", offset), at("/lidar", offset)) for offset in itertools.count(start_ms))


def _play_until_out(player: Player, collector: Collector, sets: Iterator[list[Frame]]) -> int:
    """Play one set after the other until one has come out of every output; how many were played."""
    played, before = 0, {topic: collector.count(topic) for topic in _PAIR_OUT}

    def out() -> bool:
        nonlocal played
        if all(collector.count(topic) > count for topic, count in before.items()):
            return True
        player.play(next(sets))
        played += 1
        return False

    wait_until(out, "a set")
    return played


def _endpoints(collector: Collector) -> list[str]:
    """Which topics the relay subscribes to and publishes, of those of its groups."""
    subscribed = [topic for topic in _PAIR if collector.endpoints(topic, kind="subscription", node="/syncrelay")]
    return subscribed + [
        topic for topic in _PAIR_OUT if collector.endpoints(topic, kind="publisher", node="/syncrelay")
    ]


@both_backends
def test_sets_leave_only_while_the_node_is_active(stage: Stage):
    relay, manager = stage.relay(_managed()), _Manager(stage)
    collector, player = stage.collector(_PAIR_OUT), stage.player(_PAIR)
    player.match(0)
    assert manager.state == "unconfigured"
    relay.wait_for_log("the node is unconfigured: configure it with `ros2 lifecycle set /syncrelay configure`")
    manager.watch()
    assert manager.change("configure")
    wait_until(lambda: status(relay)["relay"]["phase"] == "inactive", "the inactive relay")
    wait_until(lambda: problems(relay) == {"inactive"}, "the finding and no other")
    wait_until(lambda: page(relay, "/livez") == (200, "receiving\n"), "a relay that lives")
    for _ in range(2):
        player.play(next(_pairs(0)))
    assert _endpoints(collector) == []

    assert manager.change("activate")
    _play_until_out(player, collector, _pairs(1000))
    wait_until(lambda: status(relay)["relay"]["ready"] is True, "the ready relay")
    player.play(at("/camera", *range(5000, 5005)))
    wait_until(lambda: first_group(relay)["inputs"][0]["buffered"] == 5, "the messages that wait")
    assert manager.change("deactivate")
    assert read_summary(relay.stderr)["front"].inputs["/camera"].unneeded == 5
    wait_until(lambda: not _endpoints(collector), "the end of all that the relay had on topics")
    player.play(next(_pairs(6000)))

    assert manager.change("activate")
    played = _play_until_out(player, collector, _pairs(8000))
    stamps = stamps_of(collector.payloads("/front/lidar"))
    assert {(stamp - BEGIN) // (1000 * MS) for stamp in stamps} == {1, 8}
    expected = ["configuring", "inactive", "activating", "active", "deactivating", "inactive", "activating", "active"]

    def are_told() -> bool:
        """Whether these are the events; what was told while the manager was not heard of yet is lost to it."""
        told = manager.goals()
        return len(told) >= 6 and told == expected[-len(told) :]

    wait_until(are_told, "all events")
    _end(relay)
    # Each activation counts from nothing. The first sets may have left before they were listened to.
    came = sum(stamp >= BEGIN + 8000 * MS for stamp in stamps)
    assert came <= read_summary(relay.stderr)["front"].sets <= played


def test_a_faulty_file_fails_to_configure_and_a_mended_one_is_what_runs(stage: Stage):
    arguments = ["--ros-args", "-r", "__ns:=/robot", "-r", "__node:=fusion"]
    relay, manager = stage.relay(_managed(), *arguments), _Manager(stage, "/robot/fusion")
    path = stage.folder / "config-0.yaml"
    relay.wait_for_log("ros2 lifecycle set /robot/fusion configure")
    path.write_text(_managed().replace('"queue_size"', '"queue_sise"'))
    assert not manager.change("configure")
    assert manager.state == "unconfigured"
    wrong = "groups.front.queue_sise: unknown key, did you mean `queue_size`?"
    assert wrong in relay.stderr
    assert status(relay)["relay"]["reload_error"].splitlines()[0].endswith(": unknown key")

    path.write_text(_managed({"name": "other"}))
    assert not manager.change("configure")
    assert "`node` cannot change while the relay runs" in relay.stderr

    # Nothing runs that a file could be put in the place of.
    path.write_text(_managed(rear=_FRONT))
    refused = status(relay)["relay"]["refused_reloads"]
    relay.send(signal.SIGHUP)
    wait_until(lambda: status(relay)["relay"]["refused_reloads"] == refused + 1, "the reload to be refused")
    assert "the node is unconfigured" in status(relay)["relay"]["reload_error"]
    assert "reload failed; no groups are running:\n" in relay.stderr
    assert "keeping the running configuration" not in relay.stderr

    assert manager.change("configure")
    wait_until(lambda: [each["name"] for each in status(relay)["groups"]] == ["rear"], "the new group")
    path.write_text(_managed(rear=_FRONT, side={**_FRONT, "output_prefix": "/side"}))
    relay.send(signal.SIGHUP)
    wait_until(lambda: len(status(relay)["groups"]) == 2, "the groups of a file that is reloaded while inactive")
    assert manager.state == "inactive"
    wait_until(lambda: problems(relay, "side") == {"inactive"}, "the finding and no other")
    _end(relay, signal.SIGINT)


_LEADS_TO = {
    ("unconfigured", "configure"): "inactive",
    ("inactive", "activate"): "active",
    ("inactive", "cleanup"): "unconfigured",
    ("active", "deactivate"): "inactive",
}
_NUMBERS = {"configure": "1", "cleanup": "2", "activate": "3", "deactivate": "4"}


def test_whatever_is_asked_for_the_state_is_the_one_that_the_transitions_lead_to(stage: Stage):
    chance = random.Random(16)
    relay, manager = stage.relay(_managed({"use_sim_time": True})), _Manager(stage)
    state = "unconfigured"
    for _ in range(20):
        likely = [transition for before, transition in _LEADS_TO if before == state]
        asked = chance.choice([*likely, *likely, *_NUMBERS, "transition_success", "destroy", "fly"])
        goal = _LEADS_TO.get((state, asked))
        word = asked if chance.random() < 0.5 else _NUMBERS.get(asked, "99")
        assert manager.change(word) is (goal is not None), (state, word)
        state = goal or state
        assert manager.state == state
        assert sorted(manager.transitions("get_available_transitions")) == sorted(
            [*(transition for before, transition in _LEADS_TO if before == state), "shutdown"]
        )
        phases = {"active": {"starting", "running"}}.get(state, {state})
        assert status(relay)["relay"]["phase"] in phases
    assert {"unconfigured", "inactive", "active", "finalized"} <= manager.states
    assert set(_NUMBERS) <= set(manager.transitions("get_transition_graph"))
    while state != "active":
        ((asked, state),) = [(asked, goal) for (before, asked), goal in _LEADS_TO.items() if before == state][:1]
        assert manager.change(asked)
    summaries = relay.stderr.count("front: 0 sets")
    assert manager.change("shutdown")
    assert manager.state == "finalized"
    # It was deactivated first.
    assert relay.stderr.count("front: 0 sets") == summaries + 1
    assert not manager.change("configure")
    wait_until(lambda: status(relay)["relay"]["phase"] == "finalized", "the finalized relay")
    assert status(relay)["groups"] == []
    _end(relay)


# The real relay, whose bug shows when the node is activated.
_FAILING = """\
from syncrelay.relay.groups import Groups
def begin(self):
    raise ZeroDivisionError("no begin")
Groups.begin = begin
"""


def test_a_bug_in_a_transition_leads_back_to_unconfigured_and_diagnostics_say_so(stage: Stage):
    stage.before_each_relay(_FAILING)
    relay, manager = stage.relay(_managed()), _Manager(stage)
    collector = stage.collector({"/diagnostics": "diagnostic_msgs/msg/DiagnosticArray"})
    assert manager.change("configure")
    assert not manager.change("activate")
    assert manager.state == "unconfigured"
    assert "ZeroDivisionError: no begin" in relay.stderr
    assert status(relay)["groups"] == []
    wait_until(
        lambda: any(b"the node is unconfigured" in each for each in collector.payloads("/diagnostics")),
        "the state on /diagnostics",
    )
    relay.send(signal.SIGTERM)
    assert relay.wait() == 0


def test_who_only_looks_is_not_managed_and_the_doctor_names_the_state(stage: Stage):
    relay, manager = stage.relay(_managed()), _Manager(stage)
    assert manager.change("configure")
    path = stage.folder / "config-0.yaml"
    player = stage.player({**_PAIR, "/other": STRING})
    player.match(0)
    looking = stage.observe(_managed(), "--seconds", "3")
    told: dict[str, dict[str, Any]] = {}
    # Longer where a busy machine lets the doctor hear too little.
    for seconds in (3, 10, 40):
        argv = [sys.executable, "-m", "syncrelay", "doctor", "--json", "--live", "--config", str(path)]
        argv += ["--seconds", f"{seconds}"]
        done = preloaded.run(argv, environ=stage.environment, folder=stage.folder)
        told = {each["code"]: each for each in json.loads(done.stdout)["diagnoses"]}
        if "inactive" in told:
            break
    assert told["inactive"]["fix"] == "activate it with `ros2 lifecycle set /syncrelay activate`"
    assert looking.wait() == 1
    assert "front: " in looking.stdout
    assert manager.state == "inactive"
    _end(relay)
