"""Plays run once, side by side, whichever workers of pytest-xdist ask for them.

A play that the machine disturbed is no proof against the relay: what it fails, it may show in another one. Where the
relay itself warns in each of them that it gets too little CPU, nothing can be said.
"""

import fcntl
import os
import traceback
from collections.abc import Callable, Collection
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from tests.ros.domain import claimed_domain
from tests.ros.stage import running_stage
from tests.scenarios.play import Played

_PLAYED, _FAILED = "played", "failed"
_MOST_PLAYS = 3


@pytest.fixture(scope="session")
def _programme(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with what became of the plays, of all workers."""
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent
    folder /= "scenarios"
    folder.mkdir(exist_ok=True)
    return folder


@pytest.fixture(scope="module")
def played(_programme: Path, request: pytest.FixtureRequest) -> Played:
    """What came of the `play` of the test's module, when it was played first."""
    plays = {item.module.play for item in request.session.items if _PLAYED in getattr(item, "fixturenames", ())}
    return _outcome(_programme, request.module.play, 1, together_with=plays)


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> bool | None:
    """Run a test on another play where it fails on one that the machine disturbed."""
    if _PLAYED not in pyfuncitem.fixturenames:
        return None
    given = {name: pyfuncitem.funcargs[name] for name in pyfuncitem._fixtureinfo.argnames}  # noqa: SLF001  as pytest does
    starved: list[bool] = []
    for number in range(1, _MOST_PLAYS + 1):
        try:
            pyfuncitem.obj(**given)
        except AssertionError:
            starved.append(given[_PLAYED].starved)
            if number == _MOST_PLAYS and all(starved):
                pytest.skip(f"the machine starved all plays: {given[_PLAYED].disturbed}")
            if not given[_PLAYED].disturbed or number == _MOST_PLAYS:
                raise
            given[_PLAYED] = _outcome(pyfuncitem.funcargs["_programme"], pyfuncitem.module.play, number + 1)
        else:
            break
    return True


_Play = Callable[..., Played]


def _outcome(programme: Path, play: _Play, number: int, *, together_with: Collection[_Play] = ()) -> Played:
    """What came of a play, played for the n-th time, beside which others are played that are to be."""
    plays = {play, *together_with}
    with (programme / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with ThreadPoolExecutor(len(plays)) as pool:
            list(pool.map(lambda each: _run(each, _folder(programme, each, number)), plays))
    folder = _folder(programme, play, number)
    assert not (folder / _FAILED).exists(), (folder / _FAILED).read_text()
    return Played.from_json((folder / _PLAYED).read_text())


def _folder(programme: Path, play: _Play, number: int) -> Path:
    return programme / f"{play.__module__}-{number}"


def _run(play: _Play, folder: Path) -> None:
    if folder.exists():
        return
    folder.mkdir()
    try:
        with claimed_domain() as domain, running_stage(folder, domain) as stage:
            (folder / _PLAYED).write_text(play(stage).as_json())
    except Exception:  # noqa: BLE001  whoever needs this play tells it, the others go on
        (folder / _FAILED).write_text(traceback.format_exc())
