"""The same scripts on real Fast DDS and on the simulated ROS show a user the same."""

import multiprocessing
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Final

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from syncrelay.fastdds_files import held_by, remove_unused
from tests.conformance.player import play
from tests.conformance.real import serve
from tests.conformance.script import MARKER, TF, Script
from tests.conformance.scripts import SCRIPTS
from tests.conformance.seen import KNOWN, Seen, told
from tests.conformance.simulated import SimulatedWorld
from tests.faults.extent import IS_LONG
from tests.ros.stage import IS_COMPILED

if TYPE_CHECKING:
    from multiprocessing.connection import Connection
    from multiprocessing.context import SpawnProcess

# Of some, not all types are installed everywhere.
_OFTEN_MISSING: Final = [of for of in (TF, MARKER) if find_spec(of.partition("/")[0]) is None]
PLAYED: Final = [each for each in SCRIPTS if not any(step.keys.get("of") in _OFTEN_MISSING for step in each.steps)]
# Without the compiled path, messages of several publishers are not told apart.
_ON_DDS = [
    each
    for each in PLAYED
    if (each.is_short or IS_LONG)
    and (IS_COMPILED or not any(step.verb == "sent" and "other" in step.keys for step in each.steps))
]
_KNOWN = {(lines := text.splitlines())[0]: lines for text in KNOWN.read_text().split("\n\n")}


def _titles(scripts) -> list[str]:
    return [each.title for each in scripts]


def _simulated(script: Script, folder: Path, seed: int = 1) -> Seen:
    with SimulatedWorld(seed) as world:
        return play(script, world, folder)


def _as_far_as_told(script: Script, seen: Seen, expected: Seen) -> Seen:
    """Leave out what depends on chance."""
    return replace(seen, **{field: getattr(expected, field) for field in script.blind})


@pytest.fixture(scope="module")
def real(tmp_path_factory) -> Iterator[Callable[[Script, Path], Seen]]:
    """Plays a script on real DDS, in a process for all of them until one leaves something behind."""
    spawn = multiprocessing.get_context("spawn")
    playing: list[tuple[Connection, SpawnProcess]] = []

    def played(script: Script, folder: Path) -> Seen:
        if not playing:
            ours, theirs = spawn.Pipe()
            process = spawn.Process(target=serve, args=(theirs, tmp_path_factory.mktemp("real")))
            process.start()
            # So that what it says ends with it.
            theirs.close()
            playing.append((ours, process))
        ours, process = playing[-1]
        ours.send((script.title, folder))
        answer, is_last = ours.recv()
        if is_last:
            playing.clear()
            held = held_by(process.pid or 0)
            process.kill()
            process.join()
            remove_unused(held)
        assert isinstance(answer, Seen), answer
        return answer

    yield played
    for ours, process in playing:
        ours.send(None)
        process.join()


@pytest.mark.long
@pytest.mark.parametrize("script", PLAYED, ids=_titles(PLAYED))
def test_the_simulator_shows_what_is_known_with_any_seed(script, tmp_path):
    one, other = (_simulated(script, tmp_path, seed) for seed in (1, 2))
    assert told(script.title, one, script.blind).splitlines() == _KNOWN[script.title]
    assert one == _as_far_as_told(script, other, one)


@pytest.mark.ros
@pytest.mark.faults
@pytest.mark.parametrize("script", _ON_DDS, ids=_titles(_ON_DDS))
def test_real_dds_and_the_simulator_show_the_same(script, real, tmp_path):
    expected = _simulated(script, tmp_path)
    assert _as_far_as_told(script, real(script, tmp_path), expected) == expected
