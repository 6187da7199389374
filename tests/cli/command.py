"""The command line as a user starts it: a process of its own, or here where that is not what is tested."""

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Mapping
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO
from unittest.mock import patch

from syncrelay.cli import main
from syncrelay.cli import run as relay
from syncrelay.cli.commands import COMMANDS
from tests import preloaded

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


def example(command: str) -> list[str]:
    """The words behind `syncrelay COMMAND` in the example that a command's help ends with; "" is the relay."""
    parser = COMMANDS[command].parser() if command else relay.parser()
    (line,) = re.findall(r"^example: (?:\w+=\S+ )?syncrelay (.*)$", parser.epilog or "", re.MULTILINE)
    words = shlex.split(line.partition(" > ")[0])
    assert words[:1] == [command] or not command
    return words[bool(command) :]


def run(
    *words: str, folder: Path, stdin: str = "", environ: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run syncrelay in a folder to its end."""
    return run_python("-m", "syncrelay", *words, folder=folder, stdin=stdin, environ=environ)


def run_here(*words: str, folder: Path, environ: Mapping[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    """Run syncrelay in a folder to its end, without a process and its imports.

    For commands that read no standard input, start no thread, set up no log and leave signals alone.
    """
    with TemporaryFile("w+", newline="") as out, TemporaryFile("w+", newline="") as talk:
        with chdir(folder), patch.dict(os.environ, environ or {}), redirect_stdout(out), redirect_stderr(talk):
            code = main(words)
        return subprocess.CompletedProcess(words, code, _text(out), _text(talk))


def _text(file: IO[str]) -> str:
    file.seek(0)
    return file.read()


def run_python(
    *words: str, folder: Path, stdin: str = "", environ: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run Python with this syncrelay in a folder to its end."""
    environ = {**os.environ, **preloaded.PYTHON, **(environ or {})}
    return preloaded.run([sys.executable, *words], environ=environ, folder=folder, stdin=stdin)
