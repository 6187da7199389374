"""The relay's node as a managed one: rclpy's state machine and services, and what the relay does at each transition."""

import logging
from collections.abc import Callable
from concurrent.futures import CancelledError
from threading import Event
from typing import Any, Final, Protocol

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import GetState
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from syncrelay.errors import SyncRelayError

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


class Transitions(Protocol):
    """What is done at each transition. On the executor's thread.

    A SyncRelayError is why a transition fails: the node stays as it was. Anything else is a bug, after which
    `recover` leads back to unconfigured.
    """

    def configure(self) -> None:
        """Read the file and prepare its groups."""

    def activate(self) -> None:
        """Receive and publish."""

    def deactivate(self) -> None:
        """Receive and publish no more, and keep the groups."""

    def cleanup(self) -> None:
        """Forget the groups."""

    def shutdown(self) -> None:
        """Forget the groups for good."""

    def recover(self) -> None:
        """Forget the groups, whatever state a bug left them in."""


class ManagedNode(LifecycleNode):  # type: ignore[misc]  # LifecycleNode is untyped
    """A node with the five services and the topic of a managed node; its publishers are ordinary ones."""

    def __init__(self, name: str, *, transitions: Transitions, **keys: Any) -> None:
        """Make it, unconfigured; `keys` as for a Node."""
        self._carried_out_by = transitions
        super().__init__(name, **keys)
        self._change_state = self._service_change_state.callback
        self._service_change_state.callback = self._answer

    def on_configure(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """See Transitions."""
        return _carried_out("configure", self._carried_out_by.configure)

    def on_activate(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """See Transitions."""
        return _carried_out("activate", self._carried_out_by.activate)

    def on_deactivate(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """See Transitions."""
        return _carried_out("deactivate", self._carried_out_by.deactivate)

    def on_cleanup(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """See Transitions."""
        return _carried_out("cleanup", self._carried_out_by.cleanup)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """See Transitions; one that is active is deactivated first."""
        if state.label == "active":
            ended = self.on_deactivate(state)
            if ended != TransitionCallbackReturn.SUCCESS:
                return ended
        return _carried_out("shutdown", self._carried_out_by.shutdown)

    def on_error(self, _state: LifecycleState) -> TransitionCallbackReturn:
        """See Transitions; where it fails too, the node is finalized."""
        return _carried_out("recover", self._carried_out_by.recover)

    def _answer(self, request: Any, response: Any) -> Any:
        # For some transitions that are not possible rclpy raises an error, and the caller would wait forever.
        asked = request.transition.label or request.transition.id
        if not any(asked in (each[0], each[1]) for each in self._state_machine.available_transitions):
            state = self._state_machine.current_state[1]
            _LOG.warning("refused the transition %s: the node is %s", _NAMES.get(asked, asked), state)
            response.success = False
            return response
        return self._change_state(request, response)


def state_of(node: Any, managed: str, *, patience_s: float) -> str | None:
    """Ask for the state of a managed node, by another that is spun elsewhere; None where nobody answers in time."""
    client = node.create_client(GetState, f"{managed}/get_state")
    try:
        answered = Event()
        if not client.wait_for_service(patience_s):
            return None
        answer = client.call_async(GetState.Request())
        answer.add_done_callback(lambda _: answered.set())
        return str(answer.result().current_state.label) if answered.wait(patience_s) else None
    finally:
        node.destroy_client(client)


def _carried_out(name: str, verb: Callable[[], None]) -> TransitionCallbackReturn:
    try:
        verb()
    except SyncRelayError as error:
        _LOG.error("%s failed:\n%s", name, error)
        return TransitionCallbackReturn.FAILURE
    except CancelledError:
        # The process is ending.
        return TransitionCallbackReturn.FAILURE
    except Exception:  # noqa: BLE001  what a bug leaves, `recover` clears away
        _LOG.exception("%s failed because of a bug in syncrelay; please report it with these lines and the file:", name)
        return TransitionCallbackReturn.ERROR
    return TransitionCallbackReturn.SUCCESS
