"""Real recordings through real DDS: the sets that come out are those of the C++ ApproximateTime."""

from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from syncrelay.sync import ApproximateTime, ExactTime, Policy
from tests.faults.extent import chosen
from tests.ros import recordings, relaying
from tests.ros.cdr_messages import stamp_of
from tests.ros.configs import LOSSLESS, ROOMY, config, inputs, outputs
from tests.ros.frames import Frame
from tests.ros.stage import BACKEND, BACKENDS, Stage

pytestmark = [pytest.mark.ros, pytest.mark.real_data, pytest.mark.faults]

_MS = 1_000_000


class Case(NamedTuple):
    """A recording, how its topics are matched, and the number of sets that C++ message_filters gives."""

    name: str
    read: Callable[[Path, Sequence[str]], list[Frame]]
    topics: tuple[str, ...]
    group: dict[str, Any]
    policy: Callable[[], Policy]
    sets: int


def _approximate(slop_ns: int, *, inputs: int = 2) -> tuple[dict[str, Any], Callable[[], Policy]]:
    """The keys of a group, and its policy."""
    keys = {"policy": "approximate_time", "queue_size": ROOMY, "slop": f"{slop_ns}ns"}
    return keys, lambda: ApproximateTime(n_inputs=inputs, queue_size=ROOMY, slop_ns=slop_ns)


def _bag(name: str) -> Callable[[Path, Sequence[str]], list[Frame]]:
    return lambda data, topics: recordings.bag(data / name, topics)


_EXACT = {"policy": "exact_time", "queue_size": ROOMY}, lambda: ExactTime(n_inputs=2, queue_size=ROOMY)
_VEHICLE, _HUSKY = _bag(recordings.VEHICLE), _bag(recordings.HUSKY)
_IMU_MAGNETIC = ("/imu_data", "/magnetic_vector")
_FIX_ODOM_IMU = ("/fix", "/husky_velocity_controller/odom", "/imu/data")
IMU_MAGNETIC_EXACT = Case("imu_magnetic_exact", _VEHICLE, _IMU_MAGNETIC, *_EXACT, sets=0)
IMU_MAGNETIC = Case("imu_magnetic", _VEHICLE, _IMU_MAGNETIC, *_approximate(20_000), sets=354)
IMU_SCAN = Case("imu_scan", _VEHICLE, ("/imu_data", "/scan"), *_approximate(30 * _MS), sets=178)
FIX_ODOM_IMU = Case("fix_odom_imu", _HUSKY, _FIX_ODOM_IMU, *_approximate(50 * _MS, inputs=3), sets=987)
RGB_DEPTH = Case(
    "rgb_depth",
    lambda data, _: recordings.tum_stamps(data),
    (recordings.RGB, recordings.DEPTH),
    *_approximate(20 * _MS),
    sets=696,
)
PICTURES = RGB_DEPTH._replace(name="pictures", read=lambda data, _: recordings.tum_pictures(data), sets=39)


_PLAYED = {
    "three_groups_that_share_topics": ([IMU_MAGNETIC_EXACT, IMU_MAGNETIC, IMU_SCAN], 4),
    "pictures": ([PICTURES], 1),
    "rgb_depth": ([RGB_DEPTH], 10),
    # The husky drove for 395 s.
    "fix_odom_imu": ([FIX_ODOM_IMU], 30),
}
_NAMES = chosen(short=[*_PLAYED][:2], long=[*_PLAYED])


@pytest.mark.parametrize("backend", chosen(short=[BACKEND], long=BACKENDS))
@pytest.mark.parametrize(("cases", "speed"), [_PLAYED[name] for name in _NAMES], ids=_NAMES)
def test_a_recording_that_is_played_gives_the_sets_of_cpp(
    stage: Stage, real_data: Path, cases: list[Case], speed: float
):
    """One recording through a group per case: every output is compared with the engine's own sets."""
    topics = dict.fromkeys(topic for case in cases for topic in case.topics)
    recording = cases[0].read(real_data, list(topics))
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
