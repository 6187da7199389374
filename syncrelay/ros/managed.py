"""The relay as a managed node: it reads its files when it is configured, and relays while it is active."""

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError
from typing import TYPE_CHECKING, Final

from syncrelay.config import Config
from syncrelay.config.rereading import ConfigFiles
from syncrelay.config.wording import counted
from syncrelay.errors import SyncRelayError
from syncrelay.explain.summary import log_summary
from syncrelay.logs import LOGGER
from syncrelay.status import Phase

if TYPE_CHECKING:
    from syncrelay.ros.relay import Relay

# A request to end is seen this soon while a file is being read.
_LOOK_S: Final = 0.1


class Managed:
    """Carries out the transitions of a relay's node, on the relay's main thread; see ros.lifecycle.Transitions.

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
        LOGGER.info("configured: %s; activate the node with `ros2 lifecycle set %s activate`", groups, node)

    def activate(self) -> None:
        """Receive and publish."""
        self._relay.call(self._relay.activate).result()
        LOGGER.info("active: receiving and publishing")

    def deactivate(self) -> None:
        """Receive and publish no more, and say what became of all messages."""
        reports = self._relay.call(self._relay.deactivate).result()
        LOGGER.info("inactive: nothing is received or published")
        log_summary(reports)

    def cleanup(self) -> None:
        """Forget the groups."""
        self._forget(Phase.UNCONFIGURED)
        LOGGER.info("unconfigured: the groups are forgotten")

    def shutdown(self) -> None:
        """Forget the groups for good. The process goes on, as a managed node's does, until it is signalled."""
        self._forget(Phase.FINALIZED)
        LOGGER.info("finalized: SIGINT or SIGTERM ends the process")

    def recover(self) -> None:
        """Forget the groups, whatever state a bug left them in."""
        self._forget(Phase.UNCONFIGURED)
        LOGGER.info("unconfigured: the groups are forgotten")

    def _forget(self, phase: Phase) -> None:
        self._relay.call(lambda: self._relay.forget_groups(phase)).result()

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
