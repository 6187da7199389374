"""Files that are read again beside the relay: what is read is told once, and what hangs holds nobody up."""

import itertools
import os
import random
import re
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from functools import partial
from pathlib import Path

import pytest

from syncrelay.config import Config, rereading
from syncrelay.config.rereading import ConfigFiles, Reading
from tests.cli.command import GOOD
from tests.faults.extent import chosen
from tests.ros.processes import wait_until

OTHER = GOOD.replace("front", "rear")
_WRITERS = chosen(short=5, long=100)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    (tmp_path / "fusion.yaml").write_text(GOOD)
    return tmp_path / "fusion.yaml"


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have no busy machine make anything seem to hang."""
    monkeypatch.setattr(rereading, "_PATIENCE_S", 600.0)
    monkeypatch.setattr(rereading, "_PIPE_S", 600.0)


@pytest.fixture
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have what changed be read at the first look, and looks follow each other."""
    monkeypatch.setattr(rereading, "_SETTLED_S", 0.0)
    monkeypatch.setattr(rereading, "_LOOK_S", 0.01)


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have what hangs told soon, and a pipe still be waited for."""
    monkeypatch.setattr(rereading, "_PATIENCE_S", 0.05)


@pytest.fixture
def files(path: Path) -> Iterator[ConfigFiles]:
    with ConfigFiles([str(path)], watched=False) as opened:
        yield opened


def taken(files: ConfigFiles) -> Future[Config]:
    """What is read next."""
    return reading(files).config


def reading(files: ConfigFiles) -> Reading:
    """What is read next, and who asked for it."""
    found: list[Reading] = []

    def is_read() -> bool:
        read = files.take()
        found.extend([read] if read is not None else [])
        return bool(found)

    wait_until(is_read, "what is read")
    return found[0]


def names(read: Future[Config]) -> list[str]:
    return [group.name for group in read.result().groups]


def replace(path: Path, text: str) -> None:
    path.with_suffix(".new").write_text(text)
    path.with_suffix(".new").replace(path)


def fifo_over(path: Path) -> Path:
    os.mkfifo(path.with_suffix(".pipe"))
    path.with_suffix(".pipe").replace(path)
    return path


def test_nothing_is_read_unasked(files: ConfigFiles, path: Path):
    replace(path, OTHER)
    assert files.take() is None


def test_what_is_read_is_told_once_and_to_who_waits(files: ConfigFiles, path: Path):
    told = threading.Event()
    files.call_when_read(told.set)
    replace(path, OTHER)
    files.read_again()
    assert told.wait(60)
    assert names(taken(files)) == ["rear"]
    assert files.take() is None


@pytest.mark.usefixtures("soon")
@pytest.mark.parametrize("is_folder", [False, True], ids=["files", "directory"])
def test_files_that_come_change_and_go_are_seen_whether_each_is_named_or_their_directory(path: Path, is_folder):
    folder = path.parent / "conf"
    folder.mkdir()
    front, rear = folder / "front.yaml", folder / "rear.yaml"
    path.replace(front)
    gone = r"no \*.yaml or \*.yml file in this directory" if is_folder else r"front.yaml: no such file"
    rear.write_text("version: 1\n")
    with ConfigFiles([str(folder)] if is_folder else [str(front), str(rear)], watched=True) as files:

        def wait_for(*groups: str) -> None:
            # A change that comes while files are read is read twice: in that reading, and then for itself.
            while (read := taken(files)).exception() is not None or names(read) != list(groups):
                pass

        replace(rear, OTHER)
        wait_for("front", "rear")
        replace(front, GOOD.replace("front", "left"))
        wait_for("left", "rear")
        if is_folder:
            rear.unlink()
            wait_for("left")
        front.unlink()
        while (error := taken(files).exception()) is None:
            pass
        assert re.search(gone, str(error))
        replace(front, GOOD)
        wait_for(*(["front"] if is_folder else ["front", "rear"]))


class _Writer:
    """Writes a file as people and programs do, and knows when it is as they want it: a version in full, or none."""

    def __init__(self, path: Path, chance: random.Random) -> None:
        self._path = path
        self._chance = chance
        self._left: list[Callable[[], None]] = []
        self.is_whole = True
        self.at = 0.0

    def write(self) -> None:
        """Go on with what was begun, or begin something; then name in `at` when to go on."""
        if not self._left:
            self._left = self._chance.choice((self._in_parts, self._in_one_go, self._removed, self._written_anew))()
        self._left.pop(0)()
        self.is_whole = not self._left
        if self._path.exists():
            # The times of files count in steps of the kernel's, and these are made up.
            os.utime(self._path, ns=(0, round(self.at * 1e9)))
        self.at += self._chance.uniform(8, 12) if self.is_whole else self._chance.uniform(0, 2.5)

    def _in_parts(self) -> list[Callable[[], None]]:
        cuts = sorted(self._chance.sample(range(len(OTHER)), self._chance.randint(0, 3)))
        parts = [OTHER[begin:end] for begin, end in itertools.pairwise([0, *cuts, len(OTHER)])]
        return [partial(self._put, part, "a" if n else "w") for n, part in enumerate(parts)]

    def _in_one_go(self) -> list[Callable[[], None]]:
        return [partial(replace, self._path, f"{GOOD}# {self.at}\n")]

    def _removed(self) -> list[Callable[[], None]]:
        return [partial(self._path.unlink, missing_ok=True)]

    def _written_anew(self) -> list[Callable[[], None]]:
        return [*self._removed(), *self._in_parts()]

    def _put(self, text: str, mode: str) -> None:
        with self._path.open(mode) as file:
            file.write(text)


@pytest.mark.parametrize("is_folder", [False, True], ids=["file", "directory"])
def test_a_watched_file_is_read_when_it_is_whole_again_and_once_for_each_version(path: Path, is_folder):
    read = 0
    for seed in range(_WRITERS):
        path.write_text(GOOD)
        # Nobody enters it: the looks are these.
        files = ConfigFiles([str(path.parent if is_folder else path)], watched=True)
        writer = _Writer(path, random.Random(seed))
        versions: list[str | None] = [GOOD]
        for look in range(400):
            now = look / 2
            while writer.at <= now:
                writer.write()
            if files.have_changed(now=now):
                assert writer.is_whole, (seed, now)
                versions.append(path.read_text() if path.exists() else None)
                read += 1
            elif writer.is_whole and writer.at < now + 1:
                assert versions[-1] == (path.read_text() if path.exists() else None), (seed, now)
    assert read > 12 * _WRITERS


@pytest.mark.usefixtures("impatient")
def test_each_who_asks_while_a_read_hangs_is_told_so_once(files: ConfigFiles, path: Path):
    fifo_over(path)
    for _ in range(2):
        asked = files.read_again()
        assert reading(files).asked == (asked,)
        assert files.take() is None


def test_who_asks_while_the_files_are_read_is_told_of_what_they_are_then(files: ConfigFiles, path: Path):
    fifo = fifo_over(path)
    first = files.read_again()
    # Opens as soon as it is being read.
    with fifo.open("w") as pipe:
        second = files.read_again()
        replace(path, OTHER)
        pipe.write(GOOD)
    told: dict[Future[str], list[str]] = {}
    while second not in told:
        read = reading(files)
        told |= {asked: names(read.config) for asked in read.asked}
    assert told[second] == ["rear"]
    assert first in told
