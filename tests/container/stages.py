"""Where players and collectors run, on the host or in containers, and the sets that a relay elsewhere must publish."""

import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from syncrelay.sync import ExactTime
from tests.container.docker import HOST, IMAGE, Network
from tests.ros import relaying
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import LOSSLESS, config, inputs, outputs
from tests.ros.processes import Process
from tests.ros.stage import Player, Stage, running_stage
from tests.ros.streams import at, merged

_TESTS = Path(__file__).parents[1]
PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
FRONT = {"policy": "exact_time", "topics": inputs(PAIR, qos=LOSSLESS)}
CONFIG = config({"front": FRONT})


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


def assert_relayed(stage: Stage, topics: dict[str, str] | None = None, group: str = "front") -> Player:
    """Play on this stage and assert that a relay elsewhere publishes exactly the 20 expected sets.

    Every type of the topics must have the fields of VECTOR. Returns the player, which still runs.
    """
    topics = topics or PAIR
    first, second = topics
    played = merged(at(first, *range(0, 1000, 25)), at(second, *range(0, 1000, 50)))
    recording = [frame._replace(type_name=topics[frame.topic]) for frame in played]
    aligned = dict(zip(outputs(group, topics), topics.values(), strict=True))
    collector = stage.collector(aligned)
    player = stage.player(topics)
    relaying.connect(player, collector, recording, aligned)
    player.play(recording)
    relaying.conclude(player, collector, recording, aligned)
    expected = relaying.expected_sets(ExactTime(n_inputs=2, queue_size=10), recording, list(topics))
    assert len(expected) == 20
    assert relaying.sets_within(recording, collector, aligned) == expected
    return player
