"""Where players and collectors run: on the host, or in containers of the same image."""

import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from tests.container.docker import HOST, IMAGE, Network
from tests.ros.processes import Process
from tests.ros.stage import Stage, running_stage

_TESTS = Path(__file__).parents[1]


@contextmanager
def host_stage(folder: Path, domain: int) -> Iterator[Stage]:
    """A stage that discovers nodes beyond its host, since to DDS containers are. No other machine is on its network."""
    with running_stage(folder, domain) as stage:
        del stage.environment["ROS_AUTOMATIC_DISCOVERY_RANGE"]
        yield stage


class ContainerStage(Stage):
    """A stage whose processes are containers with the image, user and network that are set when they start."""

    def __init__(self, folder: Path, domain: int) -> None:
        super().__init__(folder, domain)
        self.image = IMAGE
        self.user = 1000
        self.network: Network = HOST

    def start(self, name: str, argv: Sequence[str], *, stdin: int = subprocess.DEVNULL) -> Process:
        # Players and collectors of any user may read and write the test's files.
        self.folder.chmod(0o755)
        for file in self.folder.iterdir():
            if file.suffix == ".frames":
                file.chmod(0o666)
        docker_run = [
            "docker",
            "run",
            "--rm",
            "--interactive",
            "--init",
            f"--network={self.network}",
            f"--user={self.user}",
            f"--env=ROS_DOMAIN_ID={self.domain}",
            "--env=PYTHONPATH=/checkout",
            f"--volume={_TESTS}:/checkout/tests:ro",
            f"--volume={self.folder}:{self.folder}",
            "--no-healthcheck",
            "--entrypoint=python3",
            self.image,
        ]
        return super().start(name, [*docker_run, *argv[1:]], stdin=stdin)
