"""Puts one small fault after the other into the package, and looks whether the tests notice.

    python -m tests.mutants --rooms sync explain --sample 200 --seed 1

Of each room so many mutants are drawn, or all are taken. For each the tests that run its lines are run, the quickest
first, in a copy of the tree, until one fails; then the files that hold them, as what a fixture makes once is looked at
by others, or worlds drawn by seeds for a module of the relay. Where only an import runs its lines, all tests of the
room are run. A mutant that hangs and one that cannot be imported is noticed too. What lives is printed.
"""

import argparse
import os
import random
import resource
import shutil
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing
from pathlib import Path
from queue import SimpleQueue
from typing import Final, NamedTuple
from xml.etree import ElementTree as ET

from coverage import CoverageData

from tests.mutants.forks import Ended, Forks
from tests.mutants.mutations import Mutant, mutants_of, mutated
from tests.simulated.finding import search

ROOT: Final = Path(__file__).parents[2]
# The whole relay on a simulated ROS. Where scripts run a module, worlds are played too.
_PLAYED: Final = "tests/conformance"
_EVALUATED: Final = "tests/simulated/test_evaluation.py"
ROOMS: Final = {
    "sync": ["tests/sync"],
    "explain": [
        "tests/explain",
        "tests/bank/test_known.py",
        "tests/status",
        "tests/cli/test_tap.py",
        # Trials on whole recordings.
        "tests/recordings/analysis",
    ],
    "dataflow": ["tests/dataflow", "tests/status/test_taps.py", _PLAYED, _EVALUATED],
    "relay": [_PLAYED, _EVALUATED, "tests/ros"],
    "recordings/bag": ["tests/recordings/bag", "tests/recordings/analysis", "tests/recordings/datasets"],
}
_LEFT_OUT: Final = "not (ros or browser or peer or process or real_data)"
# How pytest ends where a test fails; and where a test is not found, or a conftest.py cannot be imported.
_FAILED: Final = 1
_REFUSED: Final = 4
_NOT_IMPORTED: Final = "during collection"
# It may come while pytest writes, which then ends as by a fault of its own.
_TOO_LONG: Final = "from pytest-timeout"
# Tests of a mutant may take so many times as long as usual, and so much more to begin; where they wait, longer.
_PATIENCE: Final = 5
_START_S: Final = 20.0
_WAITING: Final = 4
_ALL_S: Final = 900.0
# A mutant that takes memory without end fails before the machine does.
_MEMORY: Final = 8 << 30
# So many tests are tried first: most mutants end there.
_FIRST: Final = 30
# After so many it is said how many were noticed: a run may be cut short.
_TOLD: Final = 10


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

    def are_played(self, path: str) -> bool:
        """Whether worlds run a file."""
        return any(test.startswith(_PLAYED) for tests in self.tests.get(path, {}).values() for test in tests)

    def _quickest(self, tests: set[str]) -> list[str]:
        return sorted(tests, key=lambda test: (self.seconds.get(test, 0.0), test))


def main() -> int:
    parser = argparse.ArgumentParser(prog="tests.mutants", description=__doc__)
    parser.add_argument("--rooms", nargs="+", choices=ROOMS, default=list(ROOMS), metavar="ROOM")
    parser.add_argument("--sample", type=int, help="mutants of each room; all if it is left out")
    parser.add_argument("--seed", type=int, default=1)
    worlds = "seconds of CPU in which worlds look for each that tests of the relay leave alive"
    parser.add_argument("--worlds", type=float, default=15.0, metavar="SECONDS", help=worlds)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    asked = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    for room in asked.rooms:
        _say(f"== {room}")
        mutants = drawn(room, asked.sample, asked.seed)
        noticed = 0
        for number, is_noticed in enumerate(tried(room, mutants, asked.jobs, worlds_s=asked.worlds), 1):
            noticed += is_noticed
            if number % _TOLD == 0:
                _say(f"{room}: {noticed} of {number} so far")
        _say(f"{room}: {noticed} of {len(mutants)} mutants noticed, {noticed / max(1, len(mutants)):.1%}")
    return 0


def drawn(room: str, count: int | None, seed: int) -> list[tuple[str, Mutant]]:
    """Return so many mutants of a room, or all, each with the file that it changes."""
    paths = sorted((ROOT / "syncrelay" / room).rglob("*.py"))
    found = [(str(path.relative_to(ROOT)), each) for path in paths for each in mutants_of(path.read_text())]
    if count is not None and count < len(found):
        found = random.Random(f"{seed} {room}").sample(found, count)
    return found


def tried(room: str, mutants: Sequence[tuple[str, Mutant]], jobs: int, *, worlds_s: float) -> Iterator[bool]:
    """Yield of each mutant of a room whether the tests notice it, and print those that live."""
    with tempfile.TemporaryDirectory(prefix="syncrelay-mutants-") as folder, ExitStack() as opened:
        first = Path(folder, "0")
        shutil.copytree(ROOT, first, ignore=shutil.ignore_patterns(".*", "build", "dist", "__pycache__"))
        runs = _runs(room, first)
        trees: SimpleQueue[tuple[Path, Forks]] = SimpleQueue()
        for number in range(jobs):
            tree = shutil.copytree(first, Path(folder, str(number))) if number else first
            # A mutant could be as old and as long as its module, so it leaves nothing compiled.
            forks = Forks(tree, room, ROOMS[room], {"PYTHONDONTWRITEBYTECODE": "1"})
            trees.put((tree, opened.enter_context(closing(forks))))

        def is_noticed(tried: tuple[str, Mutant]) -> bool:
            tree, forks = trees.get()
            try:
                return _is_noticed(tree, forks, *tried, runs, worlds_s=worlds_s)
            finally:
                trees.put((tree, forks))

        with ThreadPoolExecutor(jobs) as pool:
            for (path, mutant), noticed in zip(mutants, pool.map(is_noticed, mutants), strict=True):
                if not noticed:
                    _say(f"lives: {path}:{mutant.line}: {mutant.before}  ->  {mutant.after}")
                yield noticed


def _runs(room: str, tree: Path) -> Runs:
    """Run a room's tests once, note which lines each runs, and leave compiled modules."""
    settings = tree / "coverage.ini"
    settings.write_text("[run]\nconcurrency = thread, greenlet\n")
    words = ["--cov", f"syncrelay/{room}", "--cov-context", "test", "--cov-report=", "--cov-config", str(settings)]
    words += ["--junitxml", "times.xml", "-m", _LEFT_OUT, *ROOMS[room]]
    with closing(Forks(tree, room, ROOMS[room], {})) as forks:
        done = forks.run(words, cpu_s=_ALL_S, wall_s=_WAITING * _ALL_S)
    if done.code != 0:
        raise SystemExit(f"the tests fail without a mutant:\n{done.output[-2000:]}")
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


def _is_noticed(tree: Path, forks: Forks, path: str, mutant: Mutant, runs: Runs, *, worlds_s: float) -> bool:
    tests = runs.of(path, mutant)
    source = (ROOT / path).read_text()
    (tree / path).write_text(mutated(source, mutant))
    try:
        if any(_fail(forks, part, runs) for part in (tests[:_FIRST], tests[_FIRST:]) if part):
            return True
        if runs.are_played(path):
            return search(tree, seed=mutant.begin, cpu_s=worlds_s).is_found
        return bool(tests) and _fail(forks, _files(tests), runs)
    finally:
        (tree / path).write_text(source)


def _fail(forks: Forks, tests: Sequence[str], runs: Runs) -> bool:
    """Whether one of some tests, or of the tests in some files, fails, hangs or cannot be imported."""
    asked = set(tests)
    usual = [seconds for test, seconds in runs.seconds.items() if asked & {test, *_files([test])}]
    longest = f"--timeout={_START_S + _PATIENCE * max(usual):.0f}"
    cpu_s = _START_S + _PATIENCE * sum(usual)
    done = forks.run([longest, "-p", "no:pytest_cov", "-m", _LEFT_OUT, *tests], cpu_s=cpu_s, wall_s=_WAITING * cpu_s)
    if done.code == _REFUSED and tests != _files(tests):
        # Their files cannot be imported, or the mutant is in the names of tests.
        return _fail(forks, _files(tests), runs)
    if _counts(done):
        return True
    if done.code != 0:
        _say(f"pytest ended with {done.code}, which counts as nothing: {done.output[-2000:]}")
    return False


def _counts(done: Ended) -> bool:
    return done.code in (None, _FAILED, _REFUSED) or any(each in done.output for each in (_NOT_IMPORTED, _TOO_LONG))


def _files(tests: Sequence[str]) -> list[str]:
    return sorted({test.partition("::")[0] for test in tests})


def _say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
