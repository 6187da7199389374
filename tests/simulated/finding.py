"""Looks whether worlds find what is wrong with a copy of the sources: one breaks a promise that it keeps with ours."""

import os
import re
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Final, NamedTuple

_ROOT: Final = Path(__file__).parents[2]
_MOST_S: Final = 1200
_BROKEN: Final = re.compile(r"seed (\d+) breaks a promise:\n(.*)")


class Search(NamedTuple):
    """What came of a search, in seconds of CPU."""

    is_found: bool
    told: str
    cpu_s: float


def search(folder: Path, *, seed: int, cpu_s: float) -> Search:
    """Play worlds from a seed on with the sources in a folder; one that breaks a promise with ours does not count.

    A copy that cannot be imported, or that ends otherwise, is found, too.
    """
    used, broken_by_ours = 0.0, 0
    while used < cpu_s:
        output, code, more = _played(folder, "--seed", str(seed), "--cpu", str(cpu_s - used), "--as-drawn")
        used += more
        found = _BROKEN.search(output)
        if found is None:
            last = output.strip().rpartition("\n")[2]
            return Search(is_found=code != 0, told=f"ended with {code}: {last}" if code else last, cpu_s=used)
        if _played(_ROOT, "--seed", found[1], "--as-drawn")[1] == 0:
            return Search(is_found=True, told=f"seed {found[1]}: {found[2]}", cpu_s=used)
        seed, broken_by_ours = int(found[1]) + 1, broken_by_ours + 1
    said = f"{broken_by_ours} worlds break a promise with our sources, too"
    return Search(is_found=False, told=said, cpu_s=used)


def _played(folder: Path, *words: str) -> tuple[str, int, float]:
    """Play worlds with the sources in a folder: what was printed, the exit code and the seconds of CPU."""
    with tempfile.TemporaryFile() as output:
        played = subprocess.Popen(
            (sys.executable, "-m", "tests.simulated", *words),
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"},
            stdout=output,
            stderr=subprocess.STDOUT,
        )
        # A world that turns without end never looks at its clock.
        resource.prlimit(played.pid, resource.RLIMIT_CPU, (_MOST_S, _MOST_S))
        # Of several at a time, the CPU of this one.
        _, status, used = os.wait4(played.pid, 0)
        played.returncode = os.waitstatus_to_exitcode(status)
        output.seek(0)
        return output.read().decode(), played.returncode, used.ru_utime + used.ru_stime
