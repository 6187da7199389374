"""SIGTERM of a command that ends by itself: work is undone, so its exit code is 143."""

import os
import signal
import subprocess
import sys

import pytest

from tests.cli.command import ROOT

_ENVIRON = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONSAFEPATH": "1"}


@pytest.mark.parametrize(
    "words", [["export", "bag.mcap", "--config", "pipe", "-o", "out"], ["test", "pipe"]], ids=lambda words: words[0]
)
def test_a_command_that_sigterm_ends_exits_with_143_and_no_traceback(words, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    command = [sys.executable, "-m", "syncrelay", *words]
    with subprocess.Popen(command, cwd=tmp_path, env=_ENVIRON, stdout=-1, stderr=-1, text=True) as running:
        try:
            # To open it succeeds once the command reads its file, which then never comes.
            with (tmp_path / "pipe").open("w"):
                running.send_signal(signal.SIGTERM)
                output, told = running.communicate(timeout=60)
        finally:
            running.kill()
    assert (running.returncode, output, told) == (143, "", "")
