"""Real recordings straight through the engine: the sets that the C++ ApproximateTime gives."""

import os
from pathlib import Path
from typing import Any

import pytest
from rosbags.highlevel import AnyReader

from syncrelay.sync import ApproximateTime, DropReason, ExactTime, Message, SyncGroup

FOLDER = os.environ.get("SYNCRELAY_REAL_DATA", "")
MS = 1_000_000

pytestmark = [
    pytest.mark.real_data,
    pytest.mark.skipif(not FOLDER, reason="SYNCRELAY_REAL_DATA names no folder of recordings"),
]


def bag(name, *topics):
    """(topic index, header stamp) of every message, in recorded order."""
    with AnyReader([next(Path(FOLDER, name).glob("*.bag"))]) as reader:
        connections = [connection for connection in reader.connections if connection.topic in topics]
        for connection, _, data in reader.messages(connections):
            message: Any = reader.deserialize(data, connection.msgtype)
            time = message.header.stamp
            yield topics.index(connection.topic), time.sec * 10**9 + time.nanosec


def listed(name, *files):
    """(file index, stamp) of every line, by stamp."""
    stamps = []
    for index, file in enumerate(files):
        for line in Path(FOLDER, name, file).read_text().splitlines():
            if not line.startswith("#"):
                seconds, _, fraction = line.split()[0].partition(".")
                stamps.append((int(seconds) * 10**9 + int(fraction.ljust(9, "0")), index))
    return [(index, stamp) for stamp, index in sorted(stamps)]


def approximate(n_inputs, queue_size, slop_ns):
    return ApproximateTime(n_inputs=n_inputs, queue_size=queue_size, slop_ns=slop_ns)


VEHICLE = "vehicle_mtig_sick_tilt_laser"
HUSKY = "husky_jackal_robot_localization"
RECORDINGS = {
    "imu and compass, exact": (
        lambda: bag(VEHICLE, "/imu_data", "/magnetic_vector"),
        lambda: ExactTime(n_inputs=2, queue_size=20),
        0,
    ),
    "imu and compass, 20 us": (
        lambda: bag(VEHICLE, "/imu_data", "/magnetic_vector"),
        lambda: approximate(2, 20, 20_000),
        354,
    ),
    "imu and laser, 30 ms": (
        lambda: bag(VEHICLE, "/imu_data", "/scan"),
        lambda: approximate(2, 20, 30 * MS),
        178,
    ),
    "gnss, odometry and imu, 50 ms": (
        lambda: bag(HUSKY, "/fix", "/husky_velocity_controller/odom", "/imu/data"),
        lambda: approximate(3, 100, 50 * MS),
        987,
    ),
    "colour and depth, 20 ms": (
        lambda: listed("tum_rgbd/fr1_rpy", "rgb.txt", "depth.txt"),
        lambda: approximate(2, 10, 20 * MS),
        696,
    ),
}


@pytest.mark.parametrize(("stream", "make", "sets"), RECORDINGS.values(), ids=RECORDINGS)
def test_a_recording_gives_the_sets_it_gives_in_cpp_and_the_same_again(stream, make, sets):
    policy = make()
    group = SyncGroup(policy, required=(True,) * policy.n_inputs)
    events = list(stream())
    assert events
    for passes in (1, 2):
        for index, stamp in events:
            group.add(Message(index, stamp, None), now=0)
        assert group.sets == passes * sets
    group.flush(DropReason.SHUTDOWN)
    for counts in group.counts():
        assert counts.fed == counts.matched + sum(counts.dropped.values())
