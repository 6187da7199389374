"""Puts faults that were once mended in again, one at a time, and looks whether simulated worlds find them.

    python -m tests.old_faults [NAME ...] [--minutes 10] [--jobs 1] [--seed 1]

Each fault is a patch in this folder, which says what a user saw, and the commit that mended it, or that guards against
it. NAME is a part of its name. Worlds are played from a random seed on, or from --seed, until one breaks a promise or
the minutes of CPU are over. Exits with 1 where a fault is not found.
"""

import argparse
import random
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Final

from tests.simulated.finding import search

ROOT: Final = Path(__file__).parents[2]
PATCHES: Final = tuple(sorted(Path(__file__).parent.glob("*.patch")))
APPLY: Final = ("git", "apply")


def main() -> int:
    parser = argparse.ArgumentParser(prog="tests.old_faults", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--minutes", type=float, default=10.0, help="of CPU for each fault")
    parser.add_argument("--jobs", type=int, default=1, help="faults at a time")
    parser.add_argument("--seed", type=int, help="the first seed; a random one for each fault if it is left out")
    asked = parser.parse_args()
    chosen = [each for each in PATCHES if not asked.names or any(name in each.stem for name in asked.names)]
    if not chosen:
        parser.error(f"no fault is called {' or '.join(asked.names)}")
    with ThreadPoolExecutor(asked.jobs) as pool:
        seeds = [random.randrange(1_000_000) if asked.seed is None else asked.seed for _ in chosen]
        found = [*pool.map(lambda each, seed: _is_found(each, seed, asked.minutes * 60), chosen, seeds)]
    _say(f"{sum(found)} of {len(found)} faults were found")
    return int(not all(found))


def _is_found(patch: Path, seed: int, cpu_s: float) -> bool:
    with tempfile.TemporaryDirectory(prefix="syncrelay-fault-") as name:
        folder = Path(name)
        for each in ("syncrelay", "tests"):
            shutil.copytree(ROOT / each, folder / each, ignore=shutil.ignore_patterns("__pycache__"))
        subprocess.run((*APPLY, str(patch)), cwd=folder, check=True)
        found = search(folder, seed=seed, cpu_s=cpu_s)
    how = "found" if found.is_found else "not found"
    _say(f"{patch.stem}: {how} after {found.cpu_s:.0f} s of CPU, from {seed} on: {found.told}")
    return found.is_found


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
