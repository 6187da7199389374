"""Plays run once, side by side, whichever workers of pytest-xdist ask for them."""

import fcntl
import os
import traceback
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from tests.ros.domain import claimed_domain
from tests.ros.stage import running_stage
from tests.scenarios.play import Played

_PLAYED, _FAILED = "played", "failed"


@pytest.fixture(scope="session")
def _programme(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with what became of all plays that the chosen tests ask for."""
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent
    folder /= "scenarios"
    folder.mkdir(exist_ok=True)
    plays = {item.module.play for item in request.session.items if _PLAYED in getattr(item, "fixturenames", ())}
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with ThreadPoolExecutor(len(plays)) as pool:
            list(pool.map(lambda each: _run(each, folder / each.__module__), plays))
    return folder


def _run(play: Callable[..., Played], folder: Path) -> None:
    if folder.exists():
        return
    folder.mkdir()
    try:
        with claimed_domain() as domain, running_stage(folder, domain) as stage:
            (folder / _PLAYED).write_text(play(stage).as_json())
    except Exception:  # noqa: BLE001  whoever needs this play tells it, the others go on
        (folder / _FAILED).write_text(traceback.format_exc())


@pytest.fixture(scope="module")
def played(_programme: Path, request: pytest.FixtureRequest) -> Played:
    """What came of the `play` of the test's module."""
    folder = _programme / request.module.play.__module__
    assert not (folder / _FAILED).exists(), (folder / _FAILED).read_text()
    return Played.from_json((folder / _PLAYED).read_text())
