"""A process that manages nodes, as nav2's lifecycle manager does. Run as `python -m tests.ros.manager`.

It takes commands on stdin, one a line, and answers each with a line on stdout, a JSON value:

    change NODE TRANSITION      ask for a transition by its label, or its number: whether it succeeded
    state NODE                  the label of the node's state
    available NODE              the labels of the transitions that it offers now
    states NODE                 the labels of all states
    graph NODE                  the labels of all transitions
    watch NODE                  listen to the node's transition events from here on
    events                      what was heard, in the order of arrival: the labels of start and goal

It ends when stdin does.
"""

import json
import sys
import time
from typing import Any

import rclpy
from lifecycle_msgs.msg import Transition, TransitionEvent
from lifecycle_msgs.srv import ChangeState, GetAvailableStates, GetAvailableTransitions, GetState
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import get_default_context

from syncrelay.ros.environment import keep_stdout
from syncrelay.ros.leaving import leave
from tests.ros.processes import DEADLINE_S, wait_until


def main() -> None:
    # Fast DDS's own lines would be taken for answers.
    keep_stdout()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("manager")
    manager = _Manager(node)
    for line in sys.stdin:
        command, *words = line.split()
        print(json.dumps(getattr(manager, command)(*words)), flush=True)  # noqa: T201  the answer
    leave(node, get_default_context())


class _Manager:
    def __init__(self, node: Any) -> None:
        self._node = node
        self._clients: dict[str, Any] = {}
        self._events: list[list[str]] = []

    def change(self, node: str, transition: str) -> object:
        asked = {"id": int(transition)} if transition.isdigit() else {"label": transition}
        request = ChangeState.Request(transition=Transition(**asked))
        return self._answer(ChangeState, f"{node}/change_state", request).success

    def state(self, node: str) -> object:
        return self._answer(GetState, f"{node}/get_state", GetState.Request()).current_state.label

    def available(self, node: str) -> object:
        return self._transitions(f"{node}/get_available_transitions")

    def states(self, node: str) -> object:
        answer = self._answer(GetAvailableStates, f"{node}/get_available_states", GetAvailableStates.Request())
        return [state.label for state in answer.available_states]

    def graph(self, node: str) -> object:
        return self._transitions(f"{node}/get_transition_graph")

    def watch(self, node: str) -> None:
        topic = f"{node}/transition_event"
        self._node.create_subscription(TransitionEvent, topic, self._heard, 100)
        wait_until(lambda: self._node.count_publishers(topic) > 0, f"a publisher of {topic}")

    def events(self) -> object:
        rclpy.spin_once(self._node, timeout_sec=0.05)
        return self._events

    def _heard(self, event: Any) -> None:
        self._events.append([event.start_state.label, event.goal_state.label])

    def _transitions(self, service: str) -> list[str]:
        answer = self._answer(GetAvailableTransitions, service, GetAvailableTransitions.Request())
        return [each.transition.label for each in answer.available_transitions]

    def _answer(self, kind: Any, name: str, request: Any) -> Any:
        if name not in self._clients:
            self._clients[name] = self._node.create_client(kind, name)
        if not self._clients[name].wait_for_service(DEADLINE_S):
            raise TimeoutError(f"nobody offers {name}")
        future = self._clients[name].call_async(request)
        end = time.monotonic() + DEADLINE_S
        while not future.done():
            if time.monotonic() > end:
                raise TimeoutError(f"{name} was not answered")
            rclpy.spin_once(self._node, timeout_sec=1)
        return future.result()


if __name__ == "__main__":
    main()
