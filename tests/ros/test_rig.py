"""The simulated rig: its times repeat, its messages are valid, its processes end with whoever started them."""

import os
import signal
import subprocess
import sys
from itertools import islice, takewhile
from pathlib import Path

import pytest

from syncrelay.environment.quick_discovery import quick_discovery
from syncrelay.environment.transport import PROFILES
from syncrelay.fastdds_files import FOLDER
from syncrelay.rig.schedule import SENSORS, schedule
from tests.ros.domain import ports_of
from tests.ros.processes import children_of, is_alive, wait_until
from tests.ros.shared_memory import left_of, segments_of

MS = 1_000_000
SECOND = 1_000_000_000
_START = 1_700_000_000 * SECOND


def shots(name, count, *, seed=1, start=_START):
    return list(islice(schedule(SENSORS[name], seed=seed, start=start), count))


@pytest.mark.parametrize(("name", "rate_hz"), [("camera", 30), ("lidar", 10), ("imu", 100)])
def test_sensors_run_at_their_rates_but_for_what_they_lose(name, rate_hz):
    within = _START + 200 * SECOND
    sent = list(takewhile(lambda shot: shot.sent < within, schedule(SENSORS[name], seed=1, start=_START)))
    assert sent[-1].number == pytest.approx(200 * rate_hz, abs=0.1 * rate_hz)
    lost = 1 - len(sent) / sent[-1].number
    assert lost == pytest.approx(SENSORS[name].loss, abs=0.01)
    assert lost > 0


def test_the_camera_is_triggered_by_the_lidar_and_stamps_twelve_milliseconds_ahead():
    camera = {shot.number: shot.stamp for shot in shots("camera", 3000)}
    lidar = {shot.number: shot.stamp for shot in shots("lidar", 1000)}
    apart = [camera[3 * number] - stamp for number, stamp in lidar.items() if 3 * number in camera]
    assert sum(apart) / len(apart) == pytest.approx(12 * MS, abs=0.2 * MS)
    assert max(abs(gap - 12 * MS) for gap in apart) < 6 * MS


_HOLD_RIG = """
import select, sys
from syncrelay.rig.processes import Rig
with Rig(seed=1) as rig:
    while not select.select([sys.stdin], [], [], 0.1)[0]:
        rig.check()
"""


def hold(stage):
    """A process that runs the whole rig until its stdin ends."""
    process = stage.start("holder", [sys.executable, "-c", _HOLD_RIG], stdin=subprocess.PIPE)
    process.wait_until(lambda: len(children_of(process.pid)) == len(SENSORS), "the rig's processes")
    process.wait_until(lambda: all(map(segments_of, children_of(process.pid))), "shared memory of all sensors")
    stage.note_shared_memory()
    return process


# What seldom happens by itself: two that leave a port at once, and each thinks that the other removes it.
_PORTS_ARE_LEFT = """
import contextlib, os
from pathlib import Path
from syncrelay.fastdds_files import held_by
from syncrelay.ros import leaving
from tests.ros.domain import ports_of
take_from_rcl = leaving._take_from_rcl
def take_and_leave_the_ports(address):
    names = {f"fastrtps_port{port}" for port in ports_of(int(os.environ["ROS_DOMAIN_ID"]))}
    kept = {}
    for name in names & held_by(os.getpid()):
        link = Path(f"/dev/shm/kept_{os.getpid()}_{name}")
        # Another sensor that ends now may have removed it.
        with contextlib.suppress(FileNotFoundError):
            link.hardlink_to(f"/dev/shm/{name}")
            kept[name] = link
    take_from_rcl(address)
    for name, link in kept.items():
        link.replace(f"/dev/shm/{name}")
        link.unlink(missing_ok=True)
leaving._take_from_rcl = take_and_leave_the_ports
# Nobody gives up, and looks for what is left, just before it is put back.
leaving._PATIENCE_S = 40
"""


@pytest.mark.ros
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_the_sensors_end_with_the_process_that_started_them_and_the_last_removes_what_dds_left(stage, number):
    stage.before_each_sensor(_PORTS_ARE_LEFT)
    holder = hold(stage)
    sensors = children_of(holder.pid)
    held = set().union(*map(segments_of, sensors))
    # Of a sensor that another met as it left: neither had it in its list.
    (FOLDER / f"fastrtps_port{ports_of(stage.domain)[199]}").touch()
    holder.send(number)
    holder.wait()
    wait_until(lambda: not any(map(is_alive, sensors)), "the end of the rig's processes")
    # Where a sensor has no time left to put back what it kept.
    for sensor in sensors:
        for kept in FOLDER.glob(f"kept_{sensor}_*"):
            kept.unlink()
    assert left_of(stage.domain, held) == set()


_HANGS = (
    "import time; from rclpy.node import Node; from syncrelay.rig import processes; processes.LEAVE_WITHIN_S = 1; "
    "Node.destroy_node = lambda self: time.sleep(600)"
)


@pytest.mark.ros
def test_sensors_that_hang_do_not_outlive_the_process_that_started_them(stage):
    stage.before_each_sensor(_HANGS)
    holder = hold(stage)
    sensors = children_of(holder.pid)
    holder.send(signal.SIGKILL)
    wait_until(lambda: not any(map(is_alive, sensors)), "the end of the rig")


_AT_THE_END = """
import atexit, os, sys, time
def linger():
    while not os.path.exists("enough"):
        time.sleep(0.05)
if "camera" in sys.orig_argv:
    atexit.register(os._exit, 3)
if "lidar" in sys.orig_argv:
    atexit.register(linger)
"""


@pytest.mark.ros
def test_a_sensor_that_is_slow_to_end_is_waited_for_and_one_that_fails_at_its_end_is_named(stage):
    stage.before_each_sensor(_AT_THE_END)
    holder = hold(stage)
    holder.ask_to_end()
    holder.wait_until(
        lambda: any(line.startswith("waiting for the rig's") and "lidar" in line for line in holder.said),
        "words on the sensor that does not end",
    )
    (stage.folder / "enough").touch()
    assert holder.wait() == 0
    assert [line for line in holder.said if not line.startswith("waiting")] == [
        "the rig's camera ended with exit code 3: publishes /demo/camera/image_raw"
    ]
    assert stage.left_in_shared_memory() == set()


# Its patience ends when all have said something.
_AWAIT_RIG = """
import time
from syncrelay.rig import processes
processes.UP = "never said"
with processes.Rig(seed=1) as rig:
    while not all(processes._all_of(talk) for _, talk in rig._sensors.values()):
        time.sleep(0.1)
    assert not rig.is_up()
    rig._up_by = 0
    rig.is_up()
"""


@pytest.mark.ros
def test_sensors_that_never_publish_are_named(stage):
    stage.before_each_sensor("print('no license', flush=True)")
    impatient = stage.start("impatient", [sys.executable, "-c", _AWAIT_RIG])
    assert impatient.wait() == 1
    assert (
        "SyncRelayError: the rig's camera, lidar, imu did not publish within 60 s\ncamera: no license\n"
        in impatient.stderr
    )


def test_quick_discovery_is_a_profile_for_as_long_as_it_lasts(monkeypatch):
    for name in PROFILES:
        monkeypatch.delenv(name, raising=False)
    with quick_discovery():
        (profile,) = {Path(os.environ[name]) for name in PROFILES}
        assert "initialAnnouncements" in profile.read_text()
    assert os.environ.keys().isdisjoint(PROFILES)
    assert not profile.exists()


@pytest.mark.parametrize("name", PROFILES)
def test_a_profile_of_the_users_own_stays(monkeypatch, name):
    monkeypatch.delenv("FASTRTPS_DEFAULT_PROFILES_FILE", raising=False)
    monkeypatch.setenv(name, "/mine.xml")
    before = dict(os.environ)
    with quick_discovery():
        assert dict(os.environ) == before
