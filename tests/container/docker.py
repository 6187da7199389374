"""The engine's command line, and relays in containers."""

import json
import os
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NewType

from tests.ros.processes import wait_until

IMAGE = "syncrelay"
WITH_MESSAGES = "syncrelay-messages"
ON_ROS = "syncrelay-ros"
Network = NewType("Network", str)
HOST = Network("host")

# The options of compose.yaml as those of `docker run`.
HARDENED = (
    "--read-only",
    "--tmpfs=/tmp:size=16m,mode=1777",
    "--cap-drop=ALL",
    "--security-opt=no-new-privileges:true",
    "--pids-limit=64",
)
# So that a change of health shows within a second or two.
PROBED_EVERY_SECOND = ("--health-interval=1s", "--health-retries=1", "--health-start-period=60s")


def run_docker(*arguments: str, environment: dict[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    """Run a docker command, which may fail."""
    return subprocess.run(
        ["docker", *arguments],  # noqa: S607  the engine's own, first in PATH
        env={**os.environ, **(environment or {})},
        capture_output=True,
        text=True,
        check=False,
    )


def docker(*arguments: str, environment: dict[str, str] | None = None) -> str:
    """Run a docker command that must succeed, and return what it prints."""
    run = run_docker(*arguments, environment=environment)
    assert run.returncode == 0, f"docker {' '.join(arguments)}: {run.stderr}"
    return run.stdout.strip()


class Container:
    """A container."""

    def __init__(self, identity: str) -> None:
        self.id = identity

    def inspect(self) -> dict[str, Any]:
        return dict(json.loads(docker("inspect", self.id))[0])

    def logs(self) -> str:
        run = run_docker("logs", self.id)
        return run.stdout + run.stderr

    def running(self) -> bool:
        return bool(self.inspect()["State"]["Running"])

    def health(self) -> str:
        return str(self.inspect()["State"]["Health"]["Status"])

    def exit_code(self) -> int:
        """Wait for its end, and return its exit code."""
        wait_until(lambda: not self.running(), "the container's end")
        return int(self.inspect()["State"]["ExitCode"])

    def relay_pid(self) -> int | None:
        """The relay's process id outside of the container."""
        rows = docker("top", self.id, "-eo", "pid,args").splitlines()[1:]
        found = [row.split(maxsplit=1) for row in rows]
        return next((int(pid) for pid, words in found if _is_relay(words)), None)

    def shares_memory_with(self, pid: int) -> bool:
        """Whether the relay maps shared memory of a process, which Fast DDS then uses in place of the network."""
        own = self.relay_pid()
        assert own is not None
        return not _shared_memory_of(own).isdisjoint(_shared_memory_of(pid))

    def wait_for_log(self, text: str) -> None:
        wait_until(lambda: text in self.logs() or not self.running(), f"{text!r} in the container's log")
        assert text in self.logs()

    def wait_for_health(self, health: str) -> None:
        wait_until(lambda: self.health() == health or not self.running(), f"the container to be {health}, or to end")
        assert self.health() == health, self.logs()


def _shared_memory_of(pid: int) -> set[str]:
    """The inodes of Fast DDS's segments and ports that a process has mapped."""
    rows = [line.split(maxsplit=5) for line in Path(f"/proc/{pid}/maps").read_text().splitlines()]
    return {row[4] for row in rows if "/fastrtps_" in row[-1]}


def _is_relay(command_line: str) -> bool:
    # The command line of an init names the relay too.
    return "/bin/syncrelay" in command_line and "docker-init" not in command_line


class Relays:
    """Starts relays in containers on one domain."""

    def __init__(self, folder: Path, domain: int) -> None:
        self.image = IMAGE
        self._folder, self._domain = folder, domain
        self._containers: list[Container] = []

    def config(self, text: str) -> Path:
        """A file that any user can read."""
        path = self._folder / f"fusion-{len(list(self._folder.glob('fusion-*')))}.yaml"
        path.write_text(text)
        return path

    def create(self, text: str, *options: str, arguments: Sequence[str] = ()) -> Container:
        """A relay's container that is not started: options are those of `docker create`, arguments the relay's."""
        self._folder.chmod(0o755)
        created = docker(
            "create",
            f"--env=ROS_DOMAIN_ID={self._domain}",
            f"--volume={self.config(text)}:/config/fusion.yaml:ro",
            *options,
            self.image,
            *arguments,
        )
        self._containers.append(Container(created))
        return self._containers[-1]

    def run(self, text: str, *options: str, arguments: Sequence[str] = ()) -> Container:
        container = self.create(text, *options, arguments=arguments)
        docker("start", container.id)
        return container

    def remove(self) -> None:
        if self._containers:
            docker("rm", "--force", *(container.id for container in self._containers))
