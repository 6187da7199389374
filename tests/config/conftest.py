import sys
from pathlib import Path

import pytest

from tests.config.ament import make_index


@pytest.fixture(scope="session")
def ament_prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A prefix with the ament index of tests.config.ament."""
    return make_index(tmp_path_factory.mktemp("ament"))


@pytest.fixture
def environ(ament_prefix: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """An environment whose only interfaces are those of tests.config.ament."""
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    return {"AMENT_PREFIX_PATH": str(ament_prefix)}
