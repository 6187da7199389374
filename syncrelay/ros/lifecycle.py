"""The relay as a managed node: it reads its files when it is configured, and relays while it is active."""

import logging
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import GetState
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn

from syncrelay.config import Config
from syncrelay.config.rereading import ConfigFiles
from syncrelay.config.wording import counted
from syncrelay.errors import SyncRelayError
from syncrelay.explain.summary import log_summary
from syncrelay.status import Phase

if TYPE_CHECKING:
    from syncrelay.ros.relay import Relay

_LOG = logging.getLogger("syncrelay")

# A request to end is seen this soon while a file is being read.
_LOOK_S: Final = 0.1
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


class Transitions:
    """What the relay does at each transition of its node. Called on the executor's thread, done on the main thread.

    `require` raises a SyncRelayError for a file that lacks what the command line asks for; `is_stopped` tells whether
    the process is to end. If a transition raises a SyncRelayError, the node stays as it was; after any other exception
    `recover` leads back to unconfigured.
    """

    def __init__(
        self,
        relay: "Relay",
        *,
        paths: Sequence[str],
        require: Callable[[Config], None],
        is_stopped: Callable[[], bool],
    ) -> None:
        self._relay = relay
        self._paths = paths
        self._require = require
        self._is_stopped = is_stopped

    def configure(self) -> None:
        """Read the files and prepare their groups."""
        relay = self._relay
        try:
            config = self._read()
            self._require(config)
            relay.call(lambda: relay.configure(config)).result()
        except SyncRelayError as error:
            reason = error.outline
            relay.call(lambda: relay.refuse_reload(reason)).result()
            raise
        node = relay.node.get_fully_qualified_name()
        groups = counted(len(relay.groups), "group")
        _LOG.info("configured: %s; activate the node with `ros2 lifecycle set %s activate`", groups, node)

    def activate(self) -> None:
        """Receive and publish."""
        self._relay.call(self._relay.activate).result()
        _LOG.info("active: receiving and publishing")

    def deactivate(self) -> None:
        """Receive and publish no more, and say what became of all messages."""
        reports = self._relay.call(self._relay.deactivate).result()
        _LOG.info("inactive: nothing is received or published")
        log_summary(reports)

    def cleanup(self) -> None:
        """Forget the groups."""
        self._relay.call(lambda: self._relay.forget_groups(Phase.UNCONFIGURED)).result()
        _LOG.info("unconfigured: the groups are forgotten")

    recover = cleanup

    def shutdown(self) -> None:
        """Forget the groups for good. The process goes on, as a managed node's does, until it is signalled."""
        if self._relay.is_active:
            self.deactivate()
        self._relay.call(lambda: self._relay.forget_groups(Phase.FINALIZED)).result()
        _LOG.info("finalized: SIGINT or SIGTERM ends the process")

    def _read(self) -> Config:
        """Read the files; raises ConfigError, and CancelledError where the end comes first."""
        is_read = threading.Event()
        with ConfigFiles(self._paths, watched=False) as files:
            files.call_when_read(is_read.set)
            files.read_again()
            while (read := files.take()) is None:
                if self._is_stopped():
                    raise CancelledError
                is_read.wait(_LOOK_S)
            return read.config.result()


class ManagedNode(LifecycleNode):  # type: ignore[misc]  # LifecycleNode is untyped
    """A node with the five services and the topic of a managed node; its publishers are ordinary ones."""

    def __init__(self, name: str, *, transitions: Transitions, **keys: Any) -> None:
        """Make it, unconfigured; `keys` as for a Node."""
        # rclpy looks for its callbacks by these names.
        for verb in ("configure", "activate", "deactivate", "cleanup", "shutdown"):
            setattr(self, f"on_{verb}", partial(_carried_out, verb, getattr(transitions, verb)))
        self.on_error = partial(_carried_out, "recover", transitions.recover)
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


def _carried_out(name: str, verb: Callable[[], None], _state: object) -> TransitionCallbackReturn:
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
