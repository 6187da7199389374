"""A file that is read again while the relay runs: what did not change goes on, and nothing is lost of it."""

import fcntl
import os
import pty
import subprocess
import sys
import termios
from pathlib import Path
from typing import Any

import pytest

from tests import preloaded
from tests.preloaded import FROM_SCRATCH
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import LOSSLESS, ROOMY, config, inputs
from tests.ros.processes import Process, wait_until
from tests.ros.reloaded import ReloadedFile
from tests.ros.stage import Stage
from tests.ros.status import ANY_PORT, address, status

pytestmark = pytest.mark.ros

_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
_FRONT = {"policy": "approximate_time", "queue_size": ROOMY, "slop": "20ms", "topics": inputs(_PAIR, qos=LOSSLESS)}


def _rear(*, topics: tuple[str, ...] = ("/camera", "/lidar"), **keys: Any) -> dict[str, Any]:
    return {"policy": "exact_time", "topics": inputs(dict.fromkeys(topics, VECTOR), qos=LOSSLESS), **keys}


def test_several_files_run_as_one_and_each_is_watched(stage: Stage):
    second = stage.folder / "second.yaml"
    second.write_text(config({"rear": _rear()}))
    file = ReloadedFile(stage, "--config", str(second), "--watch", front=_FRONT)
    file.relay.wait_for_log("rear: waiting for")
    wait_until(lambda: [each["name"] for each in status(file.relay)["groups"]] == ["front", "rear"], "both groups")
    assert status(file.relay)["relay"]["config"] == f"{file.path}, {second}"
    second.write_text(config({"rear": _rear(), "left": _rear(output_prefix="/left")}))
    file.relay.wait_for_log("reloaded: 2 groups unchanged; ")
    file.write(config({"left": _FRONT}, metrics=ANY_PORT))
    file.relay.wait_for_log(f"of {file.path}: rename one of them")


_CHANGED_AS_IT_STARTS = """
import sys
from pathlib import Path
import syncrelay.ros.environment as environment
from syncrelay.cli import main

path, changed, require_rclpy = sys.argv[1], sys.argv[2], environment.require_rclpy

def require():
    Path(path).write_text(changed)
    require_rclpy()

environment.require_rclpy = require
sys.exit(main(["--config", path, "--watch"]))
"""


def test_a_watched_file_that_changes_while_the_relay_starts_is_read_again(stage: Stage):
    path = stage.folder / "fusion.yaml"
    path.write_text(config({"front": _FRONT}))
    changed = config({"front": _FRONT, "rear": _rear()})
    relay = stage.start("relay", [sys.executable, "-c", _CHANGED_AS_IT_STARTS, str(path), changed])
    relay.wait_for_log("reloaded: 1 group unchanged; ")


def _command(stage: Stage, relay: Process, says: str) -> subprocess.CompletedProcess[str]:
    """Have it read; again where a busy machine takes longer for it than the command waits."""
    address = relay.stderr.split("http://")[1].split("/")[0]
    words = [sys.executable, "-m", "syncrelay", "reload", "--url", address]
    for _ in range(4):
        done = preloaded.run(words, environ=stage.environment, folder=stage.folder)
        if says in done.stdout + done.stderr:
            break
    return done


def test_a_command_has_it_read_and_tells_what_came_of_it(stage: Stage):
    # The command knows a relay by the words that it was started with.
    relay = stage.relay(config({"front": _FRONT}, metrics=ANY_PORT), before=FROM_SCRATCH)
    relay.wait_for_log(f"watch with `syncrelay top --url {address(relay)}`")
    done = _command(stage, relay, "has read")
    assert (done.returncode, done.stdout.startswith("/syncrelay has read ")) == (0, True)
    (stage.folder / "config-0.yaml").write_text("groups: 5")
    failed = _command(stage, relay, "reload failed")
    assert failed.returncode == 1
    assert "/syncrelay: reload failed; it keeps its running configuration:" in failed.stderr
    assert "config-0.yaml:1:9: wrong type" in failed.stderr


def test_a_relay_ends_with_its_terminal(stage: Stage, tmp_path: Path):
    path = tmp_path / "fusion.yaml"
    path.write_text(config({"front": _FRONT}))
    ours, its = pty.openpty()
    relay = subprocess.Popen(
        [sys.executable, "-m", "syncrelay", "--config", str(path)],
        # As a user's: what a buffer holds at the end has nowhere to go.
        env={name: value for name, value in stage.environment.items() if name != "PYTHONUNBUFFERED"},
        stdin=its,
        stdout=its,
        stderr=its,
        preexec_fn=_own_terminal,  # noqa: PLW1509  this process has one thread
    )
    os.close(its)
    said = b""
    while b"waiting for" not in said:
        said += os.read(ours, 4096)
    os.close(ours)
    assert relay.wait(timeout=120) == 0


def _own_terminal() -> None:
    os.setsid()
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)
