"""Rigs that are well, and rigs of which the fault is known; tests/explain plays them in virtual time."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from tests.ros.cdr_messages import VECTOR
from tests.scenarios.streams import POINT, OnItsGrid, Stream

_KEY = re.compile(r"`(?P<key>\w+): (?P<value>[^`]+)`(?: at (?P<topic>/[\w/]+))?")
# Long enough to know how fast an input comes, and for a warning of what is not so to be logged.
ACT_S = 14.0
_OF_INPUTS = {"offset", "stamp", "qos", "type", "topic"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """One group, its sensors, and the cause that is to be found.

    In act 1 the rig is well where its scenario begins so, in act 2 it is broken, in act 3 it is mended: by the source,
    or by what was suggested, written into its file.
    """

    streams: Sequence[Stream]
    """Their topics are those of the group, below a namespace of its name."""
    options: Mapping[str, Any] = field(default_factory=dict)
    inputs: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """More keys of an input, by its topic."""
    listens_to: Sequence[str] = ()
    """The topics that the group has in its file, where they are not those of the streams."""
    first: str = ""
    """The code of the first warning, that of the cause; empty where there is none to be."""
    about: Sequence[str] = ()
    """The topics that this finding is about; none where it is about the group."""
    also: frozenset[str] = frozenset()
    """Codes that the log may name beside it."""
    never_offers: Sequence[str] = ()
    """Keys that no warning may suggest."""
    cure: Sequence[str] = ()
    """The keys of the suggestion that are written into the file for act 3."""
    heals: bool = True
    """Whether all is well in act 3."""


# A driver's samples are a little off their place, and a lidar's are not those of the camera.
_CAMERA: OnItsGrid = {"wobble_ms": 1}
_LIDAR: OnItsGrid = {"phase_ms": 7, "wobble_ms": 1}
_CAMERA_10, _LIDAR_10 = Stream("camera", 10, **_CAMERA), Stream("lidar", 10, **_LIDAR)


def _drifting(ppm: float, slop: str) -> Scenario:
    """Three inputs of which the lidar's clock runs slow."""
    return Scenario(
        streams=[Stream("camera", 10), Stream("lidar", 10, ppm=-ppm), Stream("imu", 20)],
        options={"slop": slop},
        first="clock_drift",
        about=["lidar"],
        never_offers=["slop", "offset"],
        heals=False,
    )


def _stepping(shift_ms: float) -> Scenario:
    """What NTP does to a clock that is off."""
    return Scenario(
        streams=[
            _CAMERA_10,
            Stream("lidar", 10, "1", **_LIDAR),
            Stream("lidar", 10, "23", shift_ms=shift_ms, **_LIDAR),
        ],
        first="clock_step",
        about=["lidar"],
        also=frozenset({"other_clock"}),
        never_offers=["slop"],
        heals=False,
    )


def _of_rates(camera: Sequence[float], lidar: Sequence[float], first: str, about: Sequence[str]) -> dict[str, Any]:
    """A camera and a lidar at one rate in acts 1 and 3, and at another in act 2."""
    return {
        "streams": [
            *(Stream("camera", hz, acts, **_CAMERA) for hz, acts in zip(camera, ("13", "2"), strict=True)),
            *(Stream("lidar", hz, acts, **_LIDAR) for hz, acts in zip(lidar, ("13", "2"), strict=True)),
        ],
        "first": first,
        "about": about,
    }


RIGS = {
    "well": Scenario(streams=[Stream("camera", 30, **_CAMERA), _LIDAR_10]),
    "well_with_map": Scenario(
        streams=[
            _CAMERA_10,
            # Sent once, long after its stamp.
            Stream("map", 0.005, durability="transient_local", shift_ms=-3000),
        ],
        options={"policy": "latest_time", "trigger": "/well_with_map/camera"},
        inputs={"map": {"qos": {"durability": "transient_local"}}},
    ),
    # Well too: sensors that sample at other times than each other, one whose messages take long, a recording that
    # begins again.
    "out_of_phase": Scenario(
        streams=[_CAMERA_10, Stream("lidar", 10, phase_ms=40, wobble_ms=1)], options={"slop": "60ms"}
    ),
    "lidar_comes_late": Scenario(
        streams=[_CAMERA_10, Stream("lidar", 10, late_ms=80, wobble_ms=1)], options={"slop": "30ms"}
    ),
    "looped": Scenario(
        streams=[
            Stream(topic, 10, acts, shift_ms=shift_ms)
            for topic in ("camera", "lidar")
            for acts, shift_ms in (("1", 0), ("23", -20_000))
        ]
    ),
    # Messages that come too slowly, too late, at once, or not at all.
    "camera_halves": Scenario(**_of_rates((30, 15), (10, 10), "slowed", ["camera"])),
    "lidar_halves": Scenario(**_of_rates((30, 30), (10, 5), "slowed", ["lidar"])),
    "lidar_silent": Scenario(**_of_rates((10, 10), (10, 0), "silent", ["lidar"])),
    "all_silent": Scenario(**_of_rates((10, 0), (10, 0), "silent", ["camera", "lidar"])),
    "late_camera": Scenario(
        streams=[Stream("camera", 5, late_ms=700, jitter_ms=60), Stream("imu", 100)],
        options={"slop": "10ms"},
        first="short_queue",
        about=["imu"],
        cure=["queue_size"],
    ),
    "all_in_batches": Scenario(
        streams=[Stream("camera", 10, batch_ms=1200), Stream("lidar", 10, batch_ms=1200, **_LIDAR)],
        options={"queue_size": 50},
        first="bursts",
        about=["camera", "lidar"],
        heals=False,
    ),
    "one_in_batches": Scenario(
        streams=[Stream("camera", 10, batch_ms=1200), _LIDAR_10],
        options={"queue_size": 50},
        first="bursts",
        about=["camera"],
        never_offers=["queue_size", "slop"],
        heals=False,
    ),
    "late_radar": Scenario(
        streams=[_CAMERA_10, _LIDAR_10, Stream("radar", 10, late_ms=250, jitter_ms=15)],
        inputs={"radar": {"required": False}},
        options={"max_wait": "100ms"},
        first="waiting_for_optional",
        about=["radar"],
        cure=["max_wait"],
    ),
    # Nodes that are missing, die, or come back as others.
    "elsewhere": Scenario(
        streams=[Stream("/robot1/elsewhere/camera", 5), Stream("/robot1/elsewhere/lidar", 5)],
        listens_to=["camera", "lidar"],
        first="no_publisher",
        about=["camera", "lidar"],
        heals=False,
    ),
    "lidar_dies": Scenario(
        streams=[_CAMERA_10, Stream("lidar", 10, "13", **_LIDAR)], first="no_publisher", about=["lidar"]
    ),
    "camera_returns_best_effort": Scenario(
        streams=[
            Stream("camera", 10, "1", **_CAMERA),
            Stream("camera", 10, "23", reliability="best_effort", **_CAMERA),
            _LIDAR_10,
        ],
        inputs={"camera": {"qos": {"reliability": "reliable"}}},
        first="incompatible_qos",
        about=["camera"],
        cure=["qos"],
    ),
    "camera_returns_as_points": Scenario(
        streams=[Stream("camera", 10, "1", **_CAMERA), Stream("camera", 10, "23", type=POINT, **_CAMERA), _LIDAR_10],
        first="other_type",
        about=["camera"],
        cure=["type"],
    ),
    # Stamps that are wrong.
    # No clock drifts by 1 %.
    "drift_of_1_percent": replace(_drifting(10_000, "20ms"), first="other_clock"),
    "drift_of_1000_ppm": _drifting(1000, "20ms"),
    "drift_of_200_ppm": _drifting(200, "5ms"),
    "clock_steps_back": _stepping(-2000),
    "clock_steps_on": _stepping(2000),
    "two_cameras": Scenario(
        streams=[
            Stream("camera", 10, node="left_driver"),
            Stream("camera", 10, "12", node="right_driver", phase_ms=50, shift_ms=-3000),
            _LIDAR_10,
        ],
        first="several_publishers",
        about=["camera"],
    ),
    "never_near": Scenario(
        streams=[Stream("camera", 5), Stream("imu", 50, phase_ms=10)],
        options={"slop": "2ms", "queue_size": 5},
        first="over_slop",
        never_offers=["queue_size"],
        cure=["slop"],
    ),
    "never_equal": Scenario(
        streams=[Stream("camera", 5, shift_ms=0.014), Stream("lidar", 5)],
        options={"policy": "exact_time"},
        first="over_slop",
        cure=["policy", "slop"],
    ),
    "lidar_stamped_late": Scenario(
        streams=[Stream("camera", 10), Stream("lidar", 10, shift_ms=-80)],
        options={"slop": "30ms"},
        first="constant_offset",
        about=["lidar"],
        cure=["offset"],
    ),
    "lidar_80_ms_off": Scenario(
        streams=[Stream("camera", 2), Stream("lidar", 2, shift_ms=-80)], first="over_slop", cure=["offset"]
    ),
    # GPS time is 18 s ahead of UTC, and a driver may count from the boot.
    "gps_time": Scenario(
        streams=[_CAMERA_10, Stream("lidar", 10, shift_ms=18_000, **_LIDAR)],
        first="other_clock",
        about=["lidar"],
        cure=["offset"],
    ),
    "time_since_boot": Scenario(
        streams=[_CAMERA_10, Stream("lidar", 10, clock="boot", **_LIDAR)],
        first="other_clock",
        about=["lidar"],
        never_offers=["queue_size", "slop"],
        heals=False,
    ),
    "stamps_in_pairs": Scenario(
        streams=[Stream("camera", 10, repeat=2), _LIDAR_10], first="duplicates", about=["camera"], heals=False
    ),
    "stamps_of_zero": Scenario(
        streams=[Stream("camera", 2, clock="zero"), Stream("lidar", 2)],
        options={"slop": "200ms"},
        first="unstamped",
        about=["camera"],
        cure=["stamp"],
    ),
    "cut_short": Scenario(
        streams=[Stream("camera", 10, clock="none"), _LIDAR_10], first="malformed", about=["camera"], heals=False
    ),
}

# Well too, when the relay stands still for a while.
WELL_IN_EACH_WAY = {
    "by_stamps": Scenario(streams=[_CAMERA_10, _LIDAR_10]),
    "by_receipt": Scenario(
        streams=[_CAMERA_10, _LIDAR_10],
        inputs={"camera": {"stamp": "receive"}, "lidar": {"stamp": "receive"}},
        options={"slop": "40ms"},
    ),
    "beside_an_imu": Scenario(streams=[_CAMERA_10, Stream("imu", 100)]),
    "best_effort": Scenario(streams=[replace(each, reliability="best_effort") for each in (_CAMERA_10, _LIDAR_10)]),
    "with_optional": Scenario(
        streams=[_CAMERA_10, _LIDAR_10, Stream("radar", 10, wobble_ms=1)],
        inputs={"radar": {"required": False}},
        options={"max_wait": "100ms"},
    ),
    "latest": Scenario(
        streams=[_CAMERA_10, _LIDAR_10],
        options={"policy": "latest_time", "trigger": "/latest/camera", "max_age": "300ms"},
    ),
}


def group_of(name: str, scenario: Scenario) -> dict[str, Any]:
    """The group of the relay's file."""
    topics = scenario.listens_to or list(dict.fromkeys(stream.topic for stream in scenario.streams))
    rows = [{"topic": f"/{name}/{topic}", "type": VECTOR, **scenario.inputs.get(topic, {})} for topic in topics]
    policy = {} if "policy" in scenario.options else {"policy": "approximate_time", "slop": "20ms"}
    return {**policy, **scenario.options, "topics": rows}


def placed(name: str, streams: Sequence[Stream]) -> list[Stream]:
    """The streams below the namespace of their group, each with a driver there."""
    return [
        replace(
            stream,
            topic=stream.topic if stream.topic.startswith("/") else f"/{name}/{stream.topic}",
            node=f"/{name}/{stream.driver}",
        )
        for stream in streams
    ]


def offered(text: str, about: str) -> dict[str, str]:
    """The keys that a warning about a topic suggests, with their values; those of an input behind their topic."""
    found: dict[str, str] = {}
    for offer in _KEY.finditer(text):
        topic = (offer["topic"] or about) if offer["key"] in _OF_INPUTS else ""
        found.setdefault(f"{topic} {offer['key']}".strip(), offer["value"])
    return found


def cure_in(text: str, about: str, scenario: Scenario) -> dict[str, str]:
    """What a warning suggests of that which is to be written into the file."""
    return {where: value for where, value in offered(text, about).items() if where.split()[-1] in scenario.cure}


def offers_in_vain(text: str, scenario: Scenario) -> bool:
    """Whether a warning suggests what cannot help."""
    return any(where.split()[-1] in scenario.never_offers for where in offered(text, "/"))


def write(group: dict[str, Any], changes: Mapping[str, str]) -> None:
    """Write what was offered into the group of a file."""
    for where, value in changes.items():
        topic, _, key = where.rpartition(" ")
        for owner in [row for row in group["topics"] if row["topic"] == topic] if topic else [group]:
            owner[key] = int(value) if value.isdecimal() else value
