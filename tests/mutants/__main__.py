"""Puts one small fault after the other into the package, and looks whether the tests notice.

    python -m tests.mutants --rooms sync explain --sample 200 --seed 1

Of each room so many mutants are drawn, or all are taken. For each the tests that run its lines are run, the quickest
first, in a copy of the tree, until one fails; then the files that hold them, as what a fixture makes once is looked at
by others, or for a room of the relay worlds drawn by seeds. Where only an import runs its lines, all tests of the room
are run. A mutant that hangs and one that cannot be imported is noticed too. What lives is printed.
"""

import argparse
import os
import random
import resource
import shutil
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue
from typing import Final, NamedTuple
from xml.etree import ElementTree as ET

from coverage import CoverageData

from tests.mutants.mutations import Mutant, mutants_of, mutated
from tests.simulated.finding import search

ROOT: Final = Path(__file__).parents[2]
_RELAYED: Final = ("tests/scenarios", "tests/config", "tests/status")
ROOMS: Final = {
    "sync": ["tests/sync"],
    "explain": ["tests/explain", "tests/scenarios", "tests/status", "tests/cli/test_tap.py"],
    "dataflow": ["tests/dataflow", "tests/sync", *_RELAYED],
    "relay": ["tests/dataflow", *_RELAYED],
    "recordings/bag": ["tests/recordings/bag", "tests/recordings/analysis", "tests/recordings/datasets"],
}
_PLAYED: Final = frozenset({"dataflow", "relay"})
# Each for so many seconds of CPU.
_PLAYED_S: Final = 30.0
_LEFT_OUT: Final = "not (ros or browser or peer or process or real_data)"
_PYTEST: Final = (sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "--no-header", "--tb=no")
# How pytest ends where a test fails; and where a test is not found, or a conftest.py cannot be imported.
_FAILED: Final = 1
_REFUSED: Final = 4
_NOT_IMPORTED: Final = "during collection"
# Tests of a mutant may take so many times as long as usual, and so much more to begin.
_PATIENCE: Final = 5
_START_S: Final = 60.0
# A mutant that takes memory without end fails before the machine does.
_MEMORY: Final = 8 << 30
# So many tests are tried first: most mutants end there.
_FIRST: Final = 30


class Runs(NamedTuple):
    """Which tests run each line of each file of a room, and how long each test takes."""

    tests: dict[str, dict[int, list[str]]]
    seconds: dict[str, float]

    def of(self, path: str, mutant: Mutant) -> list[str]:
        """Return the tests that run a mutant's lines, or else all, those of its file first; the quickest first."""
        lines = self.tests.get(path, {})
        found = {test for line in range(mutant.line, mutant.last_line + 1) for test in lines.get(line, ())}
        if found:
            return self._quickest(found)
        near = {test for tests in lines.values() for test in tests}
        return self._quickest(near) + self._quickest(self.seconds.keys() - near)

    def _quickest(self, tests: set[str]) -> list[str]:
        return sorted(tests, key=lambda test: (self.seconds.get(test, 0.0), test))


def main() -> int:
    parser = argparse.ArgumentParser(prog="tests.mutants", description=__doc__)
    parser.add_argument("--rooms", nargs="+", choices=ROOMS, default=list(ROOMS), metavar="ROOM")
    parser.add_argument("--sample", type=int, help="mutants of each room; all if it is left out")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    asked = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    for room in asked.rooms:
        _say(f"== {room}")
        mutants = drawn(room, asked.sample, asked.seed)
        noticed = sum(tried(room, mutants, asked.jobs))
        _say(f"{room}: {noticed} of {len(mutants)} mutants noticed, {noticed / max(1, len(mutants)):.1%}")
    return 0


def drawn(room: str, count: int | None, seed: int) -> list[tuple[str, Mutant]]:
    """Return so many mutants of a room, or all, each with the file that it changes."""
    paths = sorted((ROOT / "syncrelay" / room).rglob("*.py"))
    found = [(str(path.relative_to(ROOT)), each) for path in paths for each in mutants_of(path.read_text())]
    if count is not None and count < len(found):
        found = random.Random(f"{seed} {room}").sample(found, count)
    return found


def tried(room: str, mutants: Sequence[tuple[str, Mutant]], jobs: int) -> Iterator[bool]:
    """Yield of each mutant of a room whether the tests notice it, and print those that live."""
    with tempfile.TemporaryDirectory(prefix="syncrelay-mutants-") as folder:
        first = Path(folder, "0")
        shutil.copytree(ROOT, first, ignore=shutil.ignore_patterns(".*", "build", "dist", "__pycache__"))
        runs = _runs(room, first)
        trees: SimpleQueue[Path] = SimpleQueue()
        trees.put(first)
        for number in range(1, jobs):
            trees.put(shutil.copytree(first, Path(folder, str(number))))

        def is_noticed(tried: tuple[str, Mutant]) -> bool:
            tree = trees.get()
            try:
                return _is_noticed(tree, *tried, runs, is_played=room in _PLAYED)
            finally:
                trees.put(tree)

        with ThreadPoolExecutor(jobs) as pool:
            for (path, mutant), noticed in zip(mutants, pool.map(is_noticed, mutants), strict=True):
                if not noticed:
                    _say(f"lives: {path}:{mutant.line}: {mutant.before}  ->  {mutant.after}")
                yield noticed


def _runs(room: str, tree: Path) -> Runs:
    """Run a room's tests once, and note which lines each runs."""
    settings = tree / "coverage.ini"
    settings.write_text("[run]\nconcurrency = thread, greenlet\n")
    words = ["--cov", f"syncrelay/{room}", "--cov-context", "test", "--cov-report=", "--cov-config", str(settings)]
    done = _pytest(tree, [*words, "--junitxml", "times.xml", "-m", _LEFT_OUT, *ROOMS[room]])
    if done.returncode != 0:
        raise SystemExit(f"the tests fail without a mutant:\n{done.stdout[-2000:]}")
    data = CoverageData(str(tree / ".coverage"))
    data.read()
    tests: dict[str, dict[int, list[str]]] = {}
    for file in data.measured_files():
        lines = tests[str(Path(file).resolve().relative_to(tree.resolve()))] = defaultdict(list)
        for line, contexts in data.contexts_by_lineno(file).items():
            lines[line] = sorted({each.rpartition("|")[0] for each in contexts if each})
    cases = ET.parse(tree / "times.xml").iter("testcase")  # noqa: S314  pytest wrote it just now
    seconds = {
        f"{case.get('classname', '').replace('.', '/')}.py::{case.get('name')}": float(case.get("time", 0))
        for case in cases
        # Without one, a module that was skipped.
        if case.get("classname")
    }
    return Runs(tests, seconds)


def _is_noticed(tree: Path, path: str, mutant: Mutant, runs: Runs, *, is_played: bool) -> bool:
    tests = runs.of(path, mutant)
    source = (ROOT / path).read_text()
    (tree / path).write_text(mutated(source, mutant))
    try:
        if any(_fail(tree, part, runs) for part in (tests[:_FIRST], tests[_FIRST:]) if part):
            return True
        if is_played:
            return search(tree, seed=mutant.begin, cpu_s=_PLAYED_S).is_found
        return bool(tests) and _fail(tree, _files(tests), runs)
    finally:
        (tree / path).write_text(source)


def _fail(tree: Path, tests: Sequence[str], runs: Runs) -> bool:
    """Whether one of some tests, or of the tests in some files, fails, hangs or cannot be imported."""
    asked = set(tests)
    usual = [seconds for test, seconds in runs.seconds.items() if asked & {test, *_files([test])}]
    longest = f"--timeout={_START_S + _PATIENCE * max(usual):.0f}"
    try:
        done = _pytest(tree, [longest, "-m", _LEFT_OUT, *tests], _START_S + _PATIENCE * sum(usual))
    except subprocess.TimeoutExpired:
        return True
    if done.returncode == _REFUSED and tests != _files(tests):
        # Their files cannot be imported, or the mutant is in the names of tests.
        return _fail(tree, _files(tests), runs)
    if done.returncode not in (0, _FAILED, _REFUSED) and _NOT_IMPORTED not in done.stdout:
        _say(f"pytest ended with {done.returncode}, which counts as nothing: {(done.stdout + done.stderr)[-2000:]}")
    return done.returncode in (_FAILED, _REFUSED) or _NOT_IMPORTED in done.stdout


def _files(tests: Sequence[str]) -> list[str]:
    return sorted({test.partition("::")[0] for test in tests})


def _pytest(tree: Path, words: Sequence[str], timeout_s: float | None = None) -> subprocess.CompletedProcess[str]:
    # The first run leaves compiled modules to the others; a mutant could be as old and as long as the module itself.
    compiles = {} if timeout_s is None else {"PYTHONDONTWRITEBYTECODE": "1"}
    environ = {**os.environ, "PYTHONPATH": str(tree), **compiles}
    return subprocess.run(
        [*_PYTEST, *words], cwd=tree, env=environ, capture_output=True, text=True, timeout=timeout_s, check=False
    )


def _say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
