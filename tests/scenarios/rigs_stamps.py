"""Rigs whose stamps are wrong."""

from tests.scenarios.play import Scenario
from tests.scenarios.rigs_flow import CAMERA, LIDAR
from tests.scenarios.streams import Stream


def _drifting(ppm: float, slop: str) -> Scenario:
    """Three inputs of which the lidar's clock runs slow: only that is said, and of the lidar, in ppm."""
    return Scenario(
        streams=[Stream("camera", 10), Stream("lidar", 10, ppm=-ppm), Stream("imu", 20)],
        options={"slop": slop},
        first="clock_drift",
        says=r"lidar lose",
        never_says=r"`slop: ",
        heals=False,
    )


RIGS = {
    # Point 1: a clock that drifts.
    "drift_of_1_percent": _drifting(10_000, "20ms"),
    "drift_of_1000_ppm": _drifting(1000, "20ms"),
    "drift_of_200_ppm": _drifting(200, "5ms"),
    # Point 3: two publishers whose clocks are 3 s apart.
    "two_cameras": Scenario(
        streams=[
            Stream("camera", 10, node="left_driver"),
            Stream("camera", 10, "12", node="right_driver", phase_ms=50, shift_ms=-3000),
            Stream("lidar", 10, **LIDAR),
        ],
        first="several_publishers",
        says=r"(?=.*/two_cameras/left_driver)(?=.*/two_cameras/right_driver)(?=.*\b(2\.9|3)[\d.]* s)",
        never_says=r"loop|recording",
    ),
    # Point 8: stamps that are never within slop, beside a queue that overflows.
    "never_near": Scenario(
        streams=[Stream("camera", 5), Stream("imu", 50, phase_ms=10)],
        options={"slop": "2ms", "queue_size": 5},
        first="over_slop",
        says=r"`slop: 1[0-2][\d.]*ms`",
        never_says=r"queue_size",
        cure=["slop"],
    ),
    # Point 10: a constant distance, with the wrong frames in the sets, and with no sets.
    "lidar_stamped_late": Scenario(
        streams=[Stream("camera", 10), Stream("lidar", 10, shift_ms=-80)],
        options={"slop": "30ms"},
        first="constant_offset",
        says=r"`offset: (79|80|81)[\d.]*ms` at /lidar_stamped_late/lidar",
        cure=["offset"],
    ),
    "lidar_80_ms_off": Scenario(
        streams=[Stream("camera", 2), Stream("lidar", 2, shift_ms=-80)],
        first="over_slop",
        says=r"(?=.*`slop: 8\d[\d.]*ms`, which would give)(?=.*`offset: (79|80|81)[\d.]*ms` at /lidar_80_ms_off/lidar)",
        cure=["offset"],
    ),
    # What is not one: sensors that sample at other times than each other, and one whose messages take long.
    "out_of_phase": Scenario(
        streams=[Stream("camera", 10, wobble_ms=1), Stream("lidar", 10, phase_ms=40, wobble_ms=1)],
        options={"slop": "60ms"},
    ),
    "lidar_comes_late": Scenario(
        streams=[Stream("camera", 10, wobble_ms=1), Stream("lidar", 10, late_ms=80, wobble_ms=1)],
        options={"slop": "30ms"},
    ),
    # A recording that begins again.
    "looped": Scenario(
        streams=[
            Stream(topic, 10, acts, shift_ms=shift_ms)
            for topic in ("camera", "lidar")
            for acts, shift_ms in (("1", 0), ("23", -20_000))
        ],
    ),
    # Clocks of another epoch: GPS time is 18 s ahead of UTC, and a driver may count from the boot.
    "gps_time": Scenario(
        streams=[Stream("camera", 10, **CAMERA), Stream("lidar", 10, shift_ms=18_000, **LIDAR)],
        first="other_clock",
        says=r"/gps_time/lidar are (18|17\.9\d*|18\.0\d*) s ahead of.*`offset: -1[78]",
        cure=["offset"],
    ),
    "time_since_boot": Scenario(
        streams=[Stream("camera", 10, **CAMERA), Stream("lidar", 10, clock="boot", **LIDAR)],
        first="other_clock",
        says=r"/time_since_boot/lidar",
        never_says=r"queue_size|slop",
        heals=False,
    ),
    # What NTP does to a clock that is 2 s off.
    "clock_steps_back": Scenario(
        streams=[
            Stream("camera", 10, **CAMERA),
            Stream("lidar", 10, "1", **LIDAR),
            Stream("lidar", 10, "23", shift_ms=-2000, **LIDAR),
        ],
        first="clock_step",
        says=r"/clock_steps_back/lidar.*\b(2|1\.9\d*|2\.0\d*) s",
        also=frozenset({"other_clock"}),
        never_says=r"loop|`slop",
        heals=False,
    ),
    "clock_steps_on": Scenario(
        streams=[
            Stream("camera", 10, **CAMERA),
            Stream("lidar", 10, "1", **LIDAR),
            Stream("lidar", 10, "23", shift_ms=2000, **LIDAR),
        ],
        first="clock_step",
        says=r"/clock_steps_on/lidar.*\b(2|1\.9\d*|2\.0\d*) s",
        also=frozenset({"other_clock"}),
        never_says=r"loop|`slop",
        heals=False,
    ),
    "stamps_in_pairs": Scenario(
        streams=[Stream("camera", 10, repeat=2), Stream("lidar", 10, **LIDAR)],
        first="duplicates",
        says=r"/stamps_in_pairs/camera",
        heals=False,
    ),
    "stamps_of_zero": Scenario(
        streams=[Stream("camera", 2, clock="zero"), Stream("lidar", 2)],
        options={"slop": "200ms"},
        first="unstamped",
        says=r"/stamps_of_zero/camera have stamp 0; .*`stamp: receive` at /stamps_of_zero/camera",
        cure=["stamp"],
    ),
}
