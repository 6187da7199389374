"""Puts one small fault after the other into the package, and looks whether the tests notice.

    python -m tests.mutants --rooms sync explain --sample 200 --seed 1

Of each room so many mutants are drawn, or all are taken. For each the tests that run its lines are run, the quickest
first, in a copy of the tree, until one fails; one that hangs is noticed too. What lives is printed.
"""

import argparse
import os
import random
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

ROOT: Final = Path(__file__).parents[2]
_WORLDS: Final = "tests/simulated/test_worlds.py"
ROOMS: Final = {
    "sync": ["tests/sync"],
    "explain": ["tests/explain"],
    "dataflow": ["tests/dataflow", "tests/sync", _WORLDS],
    "relay": ["tests/dataflow", _WORLDS],
    "recordings/bag": ["tests/recordings/bag"],
}
_LEFT_OUT: Final = "not (ros or browser or peer or process or faults or real_data)"
_PYTEST: Final = (sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "--no-header", "--tb=no")
# A test of a mutant may take so many times as long as usual, and so much more to begin.
_PATIENCE: Final = 5
_START_S: Final = 60.0
# So many tests are tried first: most mutants end there.
_FIRST: Final = 30


class Runs(NamedTuple):
    """Which tests run each line of each file of a room, and how long each takes."""

    tests: dict[str, dict[int, list[str]]]
    seconds: dict[str, float]

    def of(self, path: str, mutant: Mutant) -> list[str]:
        """Return the tests that run a mutant's lines, the quickest first."""
        lines = self.tests.get(path, {})
        found = {test for line in range(mutant.line, mutant.last_line + 1) for test in lines.get(line, ())}
        return sorted(found, key=lambda test: self.seconds.get(test, 0.0))


def main() -> int:
    parser = argparse.ArgumentParser(prog="tests.mutants", description=__doc__)
    parser.add_argument("--rooms", nargs="+", choices=ROOMS, default=list(ROOMS), metavar="ROOM")
    parser.add_argument("--sample", type=int, help="mutants of each room; all if it is left out")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    asked = parser.parse_args()
    for room in asked.rooms:
        _say(f"== {room}")
        tried = _sample(room, asked.sample, asked.seed)
        noticed = sum(_tried(room, tried, asked.jobs))
        _say(f"{room}: {noticed} of {len(tried)} mutants noticed, {noticed / max(1, len(tried)):.1%}")
    return 0


def _sample(room: str, count: int | None, seed: int) -> list[tuple[str, Mutant]]:
    paths = sorted((ROOT / "syncrelay" / room).glob("*.py"))
    found = [(str(path.relative_to(ROOT)), each) for path in paths for each in mutants_of(path.read_text())]
    if count is not None and count < len(found):
        found = random.Random(f"{seed} {room}").sample(found, count)
    return found


def _tried(room: str, mutants: Sequence[tuple[str, Mutant]], jobs: int) -> Iterator[bool]:
    with tempfile.TemporaryDirectory(prefix="syncrelay-mutants-") as folder:
        trees: SimpleQueue[Path] = SimpleQueue()
        for number in range(jobs):
            tree = Path(folder, str(number))
            shutil.copytree(ROOT, tree, ignore=shutil.ignore_patterns(".*", "build", "dist", "__pycache__"))
            trees.put(tree)
        runs = _runs(room, Path(folder, "0"))

        def is_noticed(tried: tuple[str, Mutant]) -> bool:
            tree = trees.get()
            try:
                return _is_noticed(tree, *tried, runs)
            finally:
                trees.put(tree)

        with ThreadPoolExecutor(jobs) as pool:
            for (path, mutant), noticed in zip(mutants, pool.map(is_noticed, mutants), strict=True):
                if not noticed:
                    _say(f"lives: {path}:{mutant.line}: {mutant.before}  ->  {mutant.after}")
                yield noticed


def _runs(room: str, tree: Path) -> Runs:
    """Run a room's tests once, and note which lines each runs."""
    words = ["--cov", f"syncrelay/{room}", "--cov-context", "test", "--cov-report=", "--junitxml", "times.xml"]
    done = _pytest(tree, [*words, "-m", _LEFT_OUT, *ROOMS[room]], None)
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
    }
    return Runs(tests, seconds)


def _is_noticed(tree: Path, path: str, mutant: Mutant, runs: Runs) -> bool:
    tests = runs.of(path, mutant)
    source = (ROOT / path).read_text()
    (tree / path).write_text(mutated(source, mutant))
    try:
        for part in (tests[:_FIRST], tests[_FIRST:]):
            usual = sum(runs.seconds.get(test, 0.0) for test in part)
            try:
                # pytest ends with 1 where a test fails, and with 2 or 4 where a module cannot be imported.
                if part and _pytest(tree, part, _START_S + _PATIENCE * usual).returncode != 0:
                    return True
            except subprocess.TimeoutExpired:
                return True
        return False
    finally:
        (tree / path).write_text(source)


def _pytest(tree: Path, words: Sequence[str], timeout_s: float | None) -> subprocess.CompletedProcess[str]:
    environ = {**os.environ, "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run(
        [*_PYTEST, *words], cwd=tree, env=environ, capture_output=True, text=True, timeout=timeout_s, check=False
    )


def _say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
