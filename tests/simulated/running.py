"""The relay and its main thread, with what `syncrelay --config` does around it, in whatever ROS it is played."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from syncrelay.config import Config, load
from syncrelay.config.rereading import ConfigFiles
from syncrelay.relay.ports import Node, Outcome
from syncrelay.relay.relay import Relay
from syncrelay.relay.running import run, services
from syncrelay.relay.transitions import Transitions
from syncrelay.runtime import Runtime
from syncrelay.status.as_document import status_of
from syncrelay.top.plain import summary


class Running:
    """A relay of a file. `join` makes its node and its backend; call `main` on a thread of the runtime."""

    def __init__(
        self,
        path: Path,
        *,
        join: Callable[[Config], tuple[Node, Any]],
        runtime: Runtime,
        watched: bool = False,
        drained: Callable[[], object] = lambda: None,
    ) -> None:
        self.path: Final = path
        self.relay: Relay | None = None
        self.requested = self.has_ended = self._wants_reload = False
        self._join, self._runtime, self._watched, self._drained = join, runtime, watched, drained

    def take_reload(self) -> bool:
        """Whether SIGHUP has come since this was last called."""
        wanted, self._wants_reload = self._wants_reload, False
        return wanted

    def hang_up(self) -> None:
        """Send SIGHUP."""
        self._wants_reload = True
        self._wake()

    def end(self) -> None:
        """Send SIGTERM."""
        self.requested = True
        self._wake()

    def _wake(self) -> None:
        if self.relay is not None:
            self.relay.wake()

    def main(self) -> None:
        """Run until the end is asked for."""
        runtime, paths = self._runtime, [str(self.path)]
        files = ConfigFiles(paths, watched=self._watched, runtime=runtime)
        config = load(*paths)
        node, backend = self._join(config)

        def managed(relay: Relay) -> Callable[[str], Outcome]:
            is_stopped = lambda: self.requested  # noqa: E731
            return Transitions(relay, paths=paths, require=_anything, is_stopped=is_stopped, runtime=runtime).carry_out

        manage = managed if config.node.lifecycle else None
        with Relay(config, node, backend, config_paths=paths, manage=manage, runtime=runtime) as relay, files:
            files.call_when_read(relay.wake)
            relay.offer(services(relay, files, lambda: summary(status_of(relay.state())), runtime=runtime))
            self.relay = relay
            run(relay, files, self, require=_anything)
            relay.drain()
            self._drained()
        self.has_ended = True


def _anything(_: object) -> None:
    """Any file will do."""
