"""Tests of the image. `make test-container` runs them with a Docker engine of its own; without it none is collected."""

import os
import secrets
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.container.docker import Network, Relays, docker, run_docker
from tests.container.stages import ContainerStage, host_stage
from tests.ros.processes import wait_until
from tests.ros.stage import Stage

collect_ignore_glob = [] if os.environ.get("SYNCRELAY_CONTAINER_TESTS") else ["test_*.py"]


@pytest.fixture(autouse=True)
def _nothing_is_left() -> Iterator[None]:
    yield
    if left := docker("ps", "--all", "--quiet").split():
        docker("rm", "--force", *left)


@pytest.fixture
def relays(tmp_path: Path, ros_domain: int) -> Iterator[Relays]:
    """Starts relays in containers on the test's domain, and removes them."""
    started = Relays(tmp_path, ros_domain)
    try:
        yield started
    finally:
        started.remove()


@pytest.fixture
def host(tmp_path: Path, ros_domain: int) -> Iterator[Stage]:
    """Starts players and collectors on the host, as a user's nodes are."""
    with host_stage(tmp_path, ros_domain) as stage:
        yield stage


@pytest.fixture
def containers(tmp_path: Path, ros_domain: int) -> Iterator[ContainerStage]:
    """Starts players and collectors in containers."""
    stage = ContainerStage(tmp_path, ros_domain)
    try:
        yield stage
    finally:
        stage.end()


@pytest.fixture
def bridge() -> Iterator[Network]:
    """A bridge network. Tests request it first, so that it is removed after the containers that use it."""
    name = f"syncrelay-{secrets.token_hex(4)}"
    docker("network", "create", name)
    try:
        yield Network(name)
    finally:
        # Containers of `docker run --rm` are removed some time after their end.
        wait_until(lambda: run_docker("network", "rm", name).returncode == 0, "the end of all that used the bridge")
