"""Real recordings through real DDS: the sets that come out are those of the C++ ApproximateTime."""

from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from syncrelay.sync import ApproximateTime, ExactTime, Policy
from tests.ros import recordings, relaying
from tests.ros.cdr_messages import stamp_of
from tests.ros.configs import LOSSLESS, ROOMY, config, inputs, outputs
from tests.ros.frames import Frame
from tests.ros.stage import Stage, both_backends

pytestmark = [pytest.mark.ros, pytest.mark.real_data, both_backends]

_MS = 1_000_000


class Case(NamedTuple):
    """A recording, how its topics are matched, and the number of sets that C++ message_filters gives."""

    name: str
    read: Callable[[Path, Sequence[str]], list[Frame]]
    topics: tuple[str, ...]
    group: dict[str, Any]
    policy: Callable[[], Policy]
    sets: int


def _vehicle(data: Path, topics: Sequence[str]) -> list[Frame]:
    return recordings.bag(data / recordings.VEHICLE, topics)


def _husky(data: Path, topics: Sequence[str]) -> list[Frame]:
    return recordings.bag(data / recordings.HUSKY, topics)


def _tum(data: Path, _topics: Sequence[str]) -> list[Frame]:
    return recordings.tum_stamps(data)


def _pictures(data: Path, _topics: Sequence[str]) -> list[Frame]:
    return recordings.tum_pictures(data)


def _approximate(*, inputs: int, slop: int) -> Callable[[], Policy]:
    return lambda: ApproximateTime(n_inputs=inputs, queue_size=ROOMY, slop_ns=slop)


IMU_MAGNETIC_EXACT = Case(
    "imu_magnetic_exact",
    _vehicle,
    ("/imu_data", "/magnetic_vector"),
    {"policy": "exact_time", "queue_size": ROOMY},
    lambda: ExactTime(n_inputs=2, queue_size=ROOMY),
    0,
)
IMU_MAGNETIC = Case(
    "imu_magnetic",
    _vehicle,
    ("/imu_data", "/magnetic_vector"),
    {"policy": "approximate_time", "queue_size": ROOMY, "slop": "20us"},
    _approximate(inputs=2, slop=20_000),
    354,
)
IMU_SCAN = Case(
    "imu_scan",
    _vehicle,
    ("/imu_data", "/scan"),
    {"policy": "approximate_time", "queue_size": ROOMY, "slop": "30ms"},
    _approximate(inputs=2, slop=30 * _MS),
    178,
)
FIX_ODOM_IMU = Case(
    "fix_odom_imu",
    _husky,
    ("/fix", "/husky_velocity_controller/odom", "/imu/data"),
    {"policy": "approximate_time", "queue_size": ROOMY, "slop": "50ms"},
    _approximate(inputs=3, slop=50 * _MS),
    987,
)
RGB_DEPTH = Case(
    "rgb_depth",
    _tum,
    (recordings.RGB, recordings.DEPTH),
    {"policy": "approximate_time", "queue_size": ROOMY, "slop": "20ms"},
    _approximate(inputs=2, slop=20 * _MS),
    696,
)
PICTURES = RGB_DEPTH._replace(name="pictures", read=_pictures, sets=39)


@pytest.mark.parametrize(
    ("cases", "speed"),
    [
        ([IMU_MAGNETIC_EXACT, IMU_MAGNETIC, IMU_SCAN], 4),
        ([RGB_DEPTH], 10),
        # The husky drove for 395 s.
        ([FIX_ODOM_IMU], 30),
        ([PICTURES], 1),
    ],
    ids=["three_groups_that_share_topics", "rgb_depth", "fix_odom_imu", "pictures"],
)
def test_a_recording_that_is_played_gives_the_sets_of_cpp(
    stage: Stage, real_data: Path, cases: list[Case], speed: float
):
    _relay_and_compare(stage, real_data, cases, speed=speed)


def _relay_and_compare(stage: Stage, data: Path, cases: list[Case], *, speed: float) -> None:
    """Relay one recording through a group per case, and compare every output with the engine's own sets."""
    topics = dict.fromkeys(topic for case in cases for topic in case.topics)
    recording = cases[0].read(data, list(topics))
    types = relaying.topics_of(recording)
    groups = {
        case.name: {**case.group, "topics": inputs({t: types[t] for t in case.topics}, qos=LOSSLESS)} for case in cases
    }
    aligned = {
        output: types[topic]
        for case in cases
        for topic, output in zip(case.topics, outputs(case.name, case.topics), strict=True)
    }
    _, collector = relaying.relay(stage, config(groups), recording, aligned, speed=speed)
    for case in cases:
        assert len(relaying.matched_by_engine(case.policy(), recording, case.topics)) == case.sets
        expected = relaying.expected_sets(case.policy(), recording, case.topics)
        received = relaying.sets_within(recording, collector, outputs(case.name, case.topics))
        assert _stamps(received) == _stamps(expected)
        assert all(_rises(stamps) for stamps in zip(*_stamps(received), strict=True))
        assert received == expected


def _stamps(sets: Sequence[tuple[bytes, ...]]) -> list[tuple[int, ...]]:
    return [tuple(map(stamp_of, a_set)) for a_set in sets]


def _rises(stamps: Sequence[int]) -> bool:
    return all(earlier < later for earlier, later in pairwise(stamps))
