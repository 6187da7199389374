"""Tests of a colcon workspace. `make test-workspace` installs colcon and runs them; without it none is collected."""

import os

import pytest

from tests.workspace.building import COLCON, Workspace, build

collect_ignore_glob = [] if os.environ.get(COLCON) else ["test_*.py"]


@pytest.fixture(scope="session")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """A workspace with this repository in src/, built by colcon in a path with a space."""
    return build(tmp_path_factory.mktemp("a workspace"))
