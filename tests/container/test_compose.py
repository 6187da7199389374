"""Each profile of compose.yaml comes up and is healthy."""

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.container.docker import Container, docker, run_docker
from tests.container.stages import CONFIG, FRONT, assert_relayed
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import LOSSLESS, config, inputs
from tests.ros.processes import wait_until

pytestmark = pytest.mark.container

_FILE = Path(__file__).parents[2] / "docker/compose.yaml"
_REAR = {"/camera_rear": VECTOR, "/lidar_rear": VECTOR}


class Project:
    """compose.yaml with the environment of one test."""

    def __init__(self, folder: Path, domain: int) -> None:
        self.environment = {"ROS_DOMAIN_ID": str(domain), "SYNCRELAY_CONFIG": str(folder / "fusion.yaml")}
        self._folder = folder

    def up(self, text: str, *services: str) -> dict[str, Container]:
        """Bring services up, by default the default ones, and return their containers, which are healthy."""
        self._folder.chmod(0o755)
        (self._folder / "fusion.yaml").write_text(text)
        self.compose("up", "--detach", "--no-build", "--wait", *services)
        rows = self.compose("--profile=*", "ps", "--format={{.Service}} {{.ID}}").splitlines()
        containers = {service: Container(identity) for service, identity in map(str.split, rows)}
        assert {container.health() for container in containers.values()} == {"healthy"}
        return containers

    def compose(self, *words: str) -> str:
        return docker("compose", f"--file={_FILE}", *words, environment=self.environment)


@pytest.fixture
def project(tmp_path: Path, ros_domain: int) -> Iterator[Project]:
    opened = Project(tmp_path, ros_domain)
    try:
        yield opened
    finally:
        opened.compose("--profile=*", "down")


def test_compose_up_brings_one_hardened_relay_that_serves_the_host(project, host):
    project.environment |= {"SYNCRELAY_UID": "4711", "SYNCRELAY_GID": "4712"}
    containers = project.up(CONFIG)
    described = containers["syncrelay"].inspect()
    assert list(containers) == ["syncrelay"]
    assert described["Config"]["User"] == "4711:4712"
    limits = described["HostConfig"]
    assert limits["ReadonlyRootfs"]
    assert limits["Init"]
    assert limits["CapDrop"] == ["ALL"]
    assert limits["SecurityOpt"] == ["no-new-privileges:true"]
    assert limits["PidsLimit"] == 64
    assert limits["Memory"] == 1 << 30
    assert_relayed(host)


def test_what_crashed_comes_back_and_what_is_told_to_end_ends_in_order(project, host):
    relay = project.up(CONFIG)["syncrelay"]
    os.kill(relay.relay_pid(), signal.SIGKILL)
    wait_until(lambda: relay.inspect()["RestartCount"] == 1 and relay.running(), "the relay to be started again")
    assert_relayed(host)
    project.compose("stop")
    assert relay.exit_code() == 0


def test_the_shared_memory_profile_shares_it_with_nodes_on_the_host(project, host):
    project.environment |= {"SYNCRELAY_UID": str(os.getuid()), "SYNCRELAY_GID": str(os.getgid())}
    containers = project.up(CONFIG, "shared-memory")
    assert list(containers) == ["shared-memory"]
    assert containers["shared-memory"].shares_memory_with(assert_relayed(host).process.pid)


def test_the_groups_profile_runs_each_group_in_a_container_of_its_own(project, host):
    rear = {"policy": "exact_time", "topics": inputs(_REAR, qos=LOSSLESS)}
    containers = project.up(config({"front": FRONT, "rear": rear}), "front", "rear")
    assert sorted(containers) == ["front", "rear"]
    assert_relayed(host)
    assert_relayed(host, _REAR, "rear")
    collector = host.collector()
    wait_until(lambda: {"/syncrelay_front", "/syncrelay_rear"} <= set(collector.nodes()), "both relays in the graph")
    assert "rear:" not in containers["front"].logs()


def test_the_file_that_it_mounts_by_default_is_in_order(project):
    del project.environment["SYNCRELAY_CONFIG"]
    said = project.compose("run", "--rm", "--no-deps", "syncrelay", "validate", "/config/fusion.yaml")
    assert said == "/config/fusion.yaml: ok, 2 groups, 4 topics"


def test_a_file_that_is_not_there_is_an_error_and_no_folder(project, tmp_path):
    arguments = ["compose", f"--file={_FILE}", "up", "--detach", "--no-build"]
    run = run_docker(*arguments, environment=project.environment)
    assert run.returncode != 0
    assert "fusion.yaml" in run.stderr
    assert not (tmp_path / "fusion.yaml").exists()
