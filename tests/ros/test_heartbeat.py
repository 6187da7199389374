"""The receive loop's sign of life: there while it turns, idle or not, and gone while it does not."""

import os
import signal
import subprocess
import sys

import pytest

from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs
from tests.ros.processes import wait_until
from tests.ros.stage import Stage

pytestmark = pytest.mark.ros

_FRONT = {"policy": "exact_time", "topics": inputs({"/camera": VECTOR, "/lidar": VECTOR})}


def test_an_idle_relay_is_healthy_a_stopped_one_not_until_it_goes_on(stage: Stage):
    stage.environment["SYNCRELAY_HEARTBEAT"] = str(stage.folder / "beat")
    relay = stage.relay(config({"front": _FRONT}))
    wait_until(lambda: _probe(stage) == (0, "receiving"), "the first beat")
    relay.send(signal.SIGSTOP)
    wait_until(lambda: "last turned" in _probe(stage)[1], "the beats to stop")
    relay.send(signal.SIGCONT)
    wait_until(lambda: _probe(stage) == (0, "receiving"), "the beats to go on")
    relay.send(signal.SIGTERM)
    assert relay.wait() == 0
    assert _probe(stage)[0] == 1


def test_a_heartbeat_that_cannot_be_written_is_said_and_the_relay_runs_without(stage: Stage):
    stage.environment["SYNCRELAY_HEARTBEAT"] = str(stage.folder / "no" / "such" / "folder")
    relay = stage.relay(config({"front": _FRONT}))
    relay.wait_for_log("cannot be written, so there is no heartbeat: No such file or directory")
    relay.wait_for_log("front: waiting for")


def _probe(stage: Stage) -> tuple[int, str]:
    run = subprocess.run(
        [sys.executable, "-m", "syncrelay", "healthcheck"],
        env={**os.environ, **stage.environment},
        capture_output=True,
        text=True,
        check=False,
    )
    return run.returncode, run.stdout.strip()
