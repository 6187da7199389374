"""The command line as a user starts it: a process of its own."""

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).parents[2]

GOOD = """\
version: 1
groups:
  front:
    policy: exact_time
    topics:
      - {topic: /a, type: sensor_msgs/msg/Image}
      - {topic: /b, type: sensor_msgs/msg/Image}
"""
BAD = GOOD.replace("exact_time", "exact_tim")


def run(
    *words: str, folder: Path, stdin: str = "", environ: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run syncrelay in a folder to its end."""
    return run_python("-m", "syncrelay", *words, folder=folder, stdin=stdin, environ=environ)


def run_python(
    *words: str, folder: Path, stdin: str = "", environ: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run Python with this syncrelay in a folder to its end."""
    return subprocess.run(
        [sys.executable, *words],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), "PYTHONSAFEPATH": "1", **(environ or {})},
        input=stdin,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
