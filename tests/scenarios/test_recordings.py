"""What `analyze` says of recordings in which all is well, or only their recorder was held up: no false cause either."""

import re

import pytest

from tests.cli.command import run
from tests.recordings.bag.making import write_mcap, write_ros1
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs
from tests.ros.frames import Frame
from tests.ros.streams import MS, at, merged


def _file(*topics: str, **options: object) -> str:
    group = {"policy": "approximate_time", "slop": "30ms", **options}
    return config({"front": {**group, "topics": inputs(dict.fromkeys(topics, VECTOR))}})


def _received(frames: list[Frame], late_ms: float) -> list[Frame]:
    return [frame._replace(time=frame.time + round(late_ms * MS)) for frame in frames]


@pytest.fixture(scope="module")
def of_gps_and_odometry(tmp_path_factory):
    """What is said of a GPS at 1 Hz beside an odometry at 20 Hz, whose partners all come in time."""
    folder = tmp_path_factory.mktemp("gps")
    gps = _received(at("/gps", *(1000 * n + 20 for n in range(107))), 30)
    odometry = _received(at("/odometry", *(50 * n for n in range(107 * 20))), 5)
    write_mcap(folder / "rig.mcap", merged(gps, odometry))
    (folder / "f.yaml").write_text(_file("/gps", "/odometry"))
    done = run("analyze", "rig.mcap", "--config", "f.yaml", folder=folder)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def test_messages_without_a_partner_to_miss_are_no_overflow_to_who_reads(of_gps_and_odometry):
    assert "/gps: 107 received, 107 in sets" in of_gps_and_odometry
    assert "overflow" not in of_gps_and_odometry


def test_a_queue_that_gives_all_sets_is_not_shown_as_too_short(of_gps_and_odometry):
    assert re.search(r"by queue_size: .*\b107 at 10 \(in use\)", of_gps_and_odometry), of_gps_and_odometry
    assert not re.search(r"^ *(warn|error)", of_gps_and_odometry, re.MULTILINE), of_gps_and_odometry


def test_a_player_that_stood_still_is_no_network(tmp_path):
    camera, lidar = at("/camera", *(100 * n for n in range(400))), at("/lidar", *(100 * n + 5 for n in range(400)))
    # Every two seconds all that came in 1.2 s comes at once.
    held = [
        frame._replace(time=frame.time + max(0, 1200 * MS - (frame.time // MS % 2000) * MS))
        for frame in merged(camera, lidar)
    ]
    write_ros1(tmp_path / "rig.bag", sorted(held, key=lambda frame: frame.time))
    (tmp_path / "f.yaml").write_text(_file("/camera", "/lidar", queue_size=50))
    done = run("analyze", "rig.bag", "--config", "f.yaml", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    told = [line for line in done.stdout.splitlines() if "at once" in line]
    assert len(told) <= 1, told
    assert not re.search(r"network|loses|heartbeat|best effort|/the publisher", done.stdout), done.stdout
