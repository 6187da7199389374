"""A managed node of rclpy: its services and its topic, and what it has done at its transitions."""

import logging
import threading
from collections.abc import Callable
from functools import partial
from typing import Any, Final

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import GetState
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn

from syncrelay.relay.ports import Outcome

_LOG = logging.getLogger("syncrelay")

# What managers ask for by number.
_NAMES: Final = {
    Transition.TRANSITION_CONFIGURE: "configure",
    Transition.TRANSITION_CLEANUP: "cleanup",
    Transition.TRANSITION_ACTIVATE: "activate",
    Transition.TRANSITION_DEACTIVATE: "deactivate",
    Transition.TRANSITION_UNCONFIGURED_SHUTDOWN: "shutdown of an unconfigured node",
    Transition.TRANSITION_INACTIVE_SHUTDOWN: "shutdown of an inactive node",
    Transition.TRANSITION_ACTIVE_SHUTDOWN: "shutdown of an active node",
}
_RETURNS: Final = {
    Outcome.SUCCESS: TransitionCallbackReturn.SUCCESS,
    Outcome.FAILURE: TransitionCallbackReturn.FAILURE,
    Outcome.ERROR: TransitionCallbackReturn.ERROR,
}


class ManagedNode(LifecycleNode):  # type: ignore[misc]  # LifecycleNode is untyped
    """A node with the five services and the topic of a managed node; its publishers are ordinary ones."""

    carry_out: Callable[[str], Outcome]
    """Carries out its transitions; to be set before it is served."""

    def __init__(self, name: str, **keys: Any) -> None:
        """Make it, unconfigured; `keys` as for a Node."""
        # rclpy looks for its callbacks by these names.
        for verb in ("configure", "activate", "deactivate", "cleanup", "shutdown"):
            setattr(self, f"on_{verb}", partial(self._carry_out, verb))
        self.on_error = partial(self._carry_out, "recover")
        super().__init__(name, **keys)
        self._change_state = self._service_change_state.callback
        self._service_change_state.callback = self._answer

    def _answer(self, request: Any, response: Any) -> Any:
        # For some transitions that are not possible rclpy raises an error, and the caller would wait forever.
        asked = request.transition.label or request.transition.id
        if not any(asked in (each[0], each[1]) for each in self._state_machine.available_transitions):
            state = self._state_machine.current_state[1]
            _LOG.warning("refused the transition %s: the node is %s", _NAMES.get(asked, asked), state)
            response.success = False
            return response
        return self._change_state(request, response)

    def _carry_out(self, name: str, _state: object) -> TransitionCallbackReturn:
        return _RETURNS[self.carry_out(name)]


def state_of(node: Any, managed: str, *, patience_s: float) -> str | None:
    """Ask for the state of a managed node, by another that is spun elsewhere; None where nobody answers in time."""
    client = node.create_client(GetState, f"{managed}/get_state")
    try:
        answered = threading.Event()
        if not client.wait_for_service(patience_s):
            return None
        answer = client.call_async(GetState.Request())
        answer.add_done_callback(lambda _: answered.set())
        return str(answer.result().current_state.label) if answered.wait(patience_s) else None
    finally:
        node.destroy_client(client)
