"""The relay as a managed node, driven as nav2's lifecycle manager drives it."""

import json
import signal
import sys
from typing import Any

import pytest

from tests import preloaded
from tests.ros.cdr_messages import STRING, VECTOR
from tests.ros.configs import LOSSLESS, ROOMY, config, inputs
from tests.ros.processes import Process, wait_until
from tests.ros.stage import Stage
from tests.ros.status import ANY_PORT

pytest.importorskip("rclpy", reason="rclpy is not installed")

from lifecycle_msgs.msg import Transition, TransitionEvent
from lifecycle_msgs.srv import ChangeState, GetAvailableStates, GetAvailableTransitions, GetState

pytestmark = pytest.mark.ros

_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
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


# Each service twice: by a label, or by a number.
_ASKED = (
    ("fly", False, "unconfigured"),
    ("99", False, "unconfigured"),
    ("activate", False, "unconfigured"),
    ("1", True, "inactive"),
    ("activate", True, "active"),
    ("4", True, "inactive"),
    ("cleanup", True, "unconfigured"),
    ("configure", True, "inactive"),
    ("3", True, "active"),
    ("shutdown", True, "finalized"),
    ("configure", False, "finalized"),
)
_FROM = {"unconfigured": ["configure"], "inactive": ["activate", "cleanup"], "active": ["deactivate"], "finalized": []}


def test_transitions_are_asked_for_by_label_or_number_and_the_services_tell_what_there_is(stage: Stage):
    relay, manager = stage.relay(_managed({"use_sim_time": True})), _Manager(stage)
    told = stage.collector({"/diagnostics": "diagnostic_msgs/msg/DiagnosticArray"})
    wait_until(lambda: any(b"is unconfigured" in each for each in told.payloads("/diagnostics")), "it on /diagnostics")
    manager.watch()
    for asked, succeeds, state in _ASKED:
        assert (manager.change(asked), manager.state) == (succeeds, state), asked
        leaving = ["shutdown"] if state != "finalized" else []
        assert sorted(manager.transitions("get_available_transitions")) == [*_FROM[state], *leaving]
    assert _FROM.keys() <= manager.states
    assert {"configure", "cleanup", "activate", "deactivate"} <= set(manager.transitions("get_transition_graph"))
    wait_until(lambda: manager.goals()[-1:] == ["finalized"], "the event that tells it")
    _end(relay)


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
