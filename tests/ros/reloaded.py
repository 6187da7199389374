"""The file of a running relay, written anew and read again."""

import signal
from typing import Any

from tests.ros.configs import config
from tests.ros.processes import wait_until
from tests.ros.stage import Stage
from tests.ros.status import ANY_PORT, status


class ReloadedFile:
    """The file of a relay, which it reads again."""

    def __init__(self, stage: Stage, *arguments: str, **groups: Any) -> None:
        self.relay = stage.relay(config(groups, metrics=ANY_PORT), *arguments)
        self.path = stage.folder / "config-0.yaml"
        if not self.path.exists():
            self.path = max(stage.folder.glob("config-*.yaml"))
        self.relay.wait_for_log("status and metrics: ")

    def write(self, text: str) -> None:
        # In one go: a file that is half written is no file of the user's.
        new = self.path.with_suffix(".new")
        new.write_text(text)
        new.replace(self.path)

    def reload(self, **groups: Any) -> None:
        """Write the file, have it read, and wait until it is taken."""
        self.write(config(groups, metrics=ANY_PORT))
        taken, refused = self.count("reloads"), self.count("refused_reloads")
        self.relay.send(signal.SIGHUP)
        wait_until(
            lambda: self.count("reloads") + self.count("refused_reloads") > taken + refused, "the file to be read"
        )
        assert self.count("reloads") == taken + 1, status(self.relay)["relay"]["reload_error"]

    def count(self, what: str) -> int:
        return int(status(self.relay)["relay"][what])
