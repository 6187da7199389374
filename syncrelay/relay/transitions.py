"""What the relay does as a managed node: it reads its files when it is configured, and relays while it is active."""

import logging
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError
from typing import TYPE_CHECKING, Final

from syncrelay.config import Config
from syncrelay.config.rereading import ConfigFiles
from syncrelay.config.wording import counted
from syncrelay.errors import SyncRelayError
from syncrelay.explain.summary import log_summary
from syncrelay.relay.ports import Outcome
from syncrelay.runtime import SYSTEM, Runtime
from syncrelay.status import Phase

if TYPE_CHECKING:
    from syncrelay.relay.relay import Relay

_LOG = logging.getLogger("syncrelay")

# A request to end is seen this soon while a file is being read.
_LOOK_S: Final = 0.1


class Transitions:
    """What the relay does at each transition of its node. Called on the thread that serves it, done on the main thread.

    `require` raises a SyncRelayError for a file that lacks what the command line asks for; `is_stopped` tells whether
    the process is to end.
    """

    def __init__(
        self,
        relay: "Relay",
        *,
        paths: Sequence[str],
        require: Callable[[Config], None],
        is_stopped: Callable[[], bool],
        runtime: Runtime = SYSTEM,
    ) -> None:
        self._relay = relay
        self._paths = paths
        self._require = require
        self._is_stopped = is_stopped
        self._runtime = runtime

    def carry_out(self, name: str) -> Outcome:
        """Carry out a transition, or `recover`."""
        try:
            getattr(self, name)()
        except SyncRelayError as error:
            _LOG.error("%s failed:\n%s", name, error)
            return Outcome.FAILURE
        except CancelledError:
            # The process is ending.
            return Outcome.FAILURE
        except Exception:  # noqa: BLE001  what a bug leaves, `recover` clears away
            _LOG.exception(
                "%s failed because of a bug in syncrelay; please report it with these lines and the file:", name
            )
            return Outcome.ERROR
        return Outcome.SUCCESS

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
        node = relay.node.name
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

    def recover(self) -> None:
        """Forget the groups, of which nothing is known after a bug."""
        self.cleanup()

    def shutdown(self) -> None:
        """Forget the groups for good. The process goes on, as a managed node's does, until it is signalled."""
        if self._relay.is_active:
            self.deactivate()
        self._relay.call(lambda: self._relay.forget_groups(Phase.FINALIZED)).result()
        _LOG.info("finalized: SIGINT or SIGTERM ends the process")

    def _read(self) -> Config:
        """Read the files; raises ConfigError, and CancelledError where the end comes first."""
        is_read = self._runtime.rest()
        with ConfigFiles(self._paths, watched=False, runtime=self._runtime) as files:
            files.call_when_read(is_read.set)
            files.read_again()
            while (read := files.take()) is None:
                if self._is_stopped():
                    raise CancelledError
                is_read.wait(_LOOK_S)
            return read.config.result()
