"""What `make` and CI begin with works on a machine that has told them nothing."""

import subprocess
import sys
from pathlib import Path

_ROOT = Path(__file__).parents[1]


def test_a_python_is_found_where_not_even_home_is_set(tmp_path):
    (tmp_path / "python3.12").symlink_to(sys.executable)
    found = subprocess.run(
        ["/bin/sh", str(_ROOT / ".ci" / "python"), "--all"],
        env={"PATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (found.returncode, found.stderr) == (0, "")
    assert len(found.stdout.splitlines()) == 1
