"""Puts faults that were once mended in again, one at a time, and looks whether simulated worlds find them.

    python -m tests.old_faults [NAME ...] [--minutes 10] [--jobs 1] [--seed 1]

Each fault is a patch in this folder, which says what a user saw, and the commit that mended it, or that guards against
it. NAME is a part of its name. Worlds are played from a random seed on, or from --seed, until one breaks a promise or
the minutes of CPU are over. Exits with 1 where a fault is not found.
"""

import argparse
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[2]
PATCHES: Final = tuple(sorted(Path(__file__).parent.glob("*.patch")))
APPLY: Final = ("git", "apply")
_BROKEN: Final = re.compile(r"seed (\d+) breaks a promise:\n(.*)")


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
    """Play worlds with the fault; one that breaks a promise without it too does not count."""
    with tempfile.TemporaryDirectory(prefix="syncrelay-fault-") as folder:
        for each in ("syncrelay", "tests"):
            shutil.copytree(ROOT / each, Path(folder, each), ignore=shutil.ignore_patterns("__pycache__"))
        subprocess.run((*APPLY, str(patch)), cwd=folder, check=True)
        first, left_s = seed, cpu_s
        while True:
            output, code, used_s = _played(folder, "--seed", str(seed), "--cpu", str(left_s), "--as-drawn")
            left_s -= used_s
            broken = _BROKEN.search(output)
            if broken is None:
                ended = "not found" if code == 0 else f"ended with {code}"
                last = output.strip().rpartition("\n")[2]
                _say(f"{patch.stem}: {ended} from seed {first} on in {cpu_s - left_s:.0f} s: {last}")
                return code != 0
            if _played(str(ROOT), "--seed", broken[1], "--as-drawn")[1] == 0:
                spent = f"after {cpu_s - left_s:.0f} s of CPU, from {first} on"
                _say(f"{patch.stem}: found by seed {broken[1]} {spent}: {broken[2]}")
                return True
            seed = int(broken[1]) + 1
            _say(f"{patch.stem}: seed {broken[1]} breaks a promise without it, too")
            if left_s <= 0:
                return False


def _played(folder: str, *words: str) -> tuple[str, int, float]:
    """Play worlds with the sources in a folder: what was printed, the exit code and the seconds of CPU."""
    with tempfile.TemporaryFile() as output:
        played = subprocess.Popen(
            (sys.executable, "-m", "tests.simulated", *words),
            cwd=folder,
            env={**os.environ, "PYTHONPATH": folder, "PYTHONDONTWRITEBYTECODE": "1"},
            stdout=output,
            stderr=subprocess.STDOUT,
        )
        # Of several at a time, the CPU of this one.
        _, status, used = os.wait4(played.pid, 0)
        played.returncode = os.waitstatus_to_exitcode(status)
        output.seek(0)
        return output.read().decode(), played.returncode, used.ru_utime + used.ru_stime


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
