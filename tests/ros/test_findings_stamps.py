"""Rigs whose stamps are broken in every way that the relay has a word for: groups of one relay, and what it says."""

import re
from collections.abc import Iterator, Sequence
from typing import Any

import pytest

from tests.ros.cdr_messages import VECTOR, vector, with_stamp
from tests.ros.configs import config, inputs
from tests.ros.domain import claimed_domain
from tests.ros.frames import Frame
from tests.ros.processes import Process, wait_until
from tests.ros.sensors import APPROXIMATE, LASTED, assert_logged, stream
from tests.ros.stage import running_stage
from tests.ros.status import ANY_PORT, findings, wait_for_finding
from tests.ros.streams import BEGIN, MS, merged

pytestmark = pytest.mark.ros

EXACT = {"policy": "exact_time"}
EQUAL_KEY = {"policy": "equal_key", "key": "header.frame_id"}
# After so long, a recording begins anew.
_LOOP_MS = 10_000


def _keyed(topic: str, key: str) -> list[Frame]:
    """Messages whose frame_id is the key and a running number."""
    return [
        frame._replace(payload=vector(BEGIN + n * MS, frame_id=f"{key}{n}"))
        for n, frame in enumerate(stream(topic, hz=10))
    ]


def _in_turn(*streams: Sequence[Frame]) -> list[Frame]:
    """The first message of the first stream, the second of the second, and so on round."""
    return [together[n % len(streams)] for n, together in enumerate(zip(*streams, strict=True))]


def _looped(frames: Sequence[Frame]) -> list[Frame]:
    """The same messages at the same times, with stamps of the first seconds over and over."""
    return [frame._replace(payload=vector(BEGIN + (frame.time - BEGIN) % (_LOOP_MS * MS))) for frame in frames]


def _drifting(frames: Sequence[Frame]) -> list[Frame]:
    return [frame._replace(payload=vector(BEGIN + round((frame.time - BEGIN) * 0.998))) for frame in frames]


CAMERA, LIDAR = stream("/camera", hz=10), stream("/lidar", hz=10)
SLOW_CAMERA = stream("/camera", hz=5)

# What the topics of a group of this name send, below a namespace of its name.
RIGS: dict[str, Sequence[Sequence[Frame]]] = {
    "unset": ([frame._replace(payload=with_stamp(frame.payload, 0)) for frame in CAMERA], LIDAR),
    "other_clock": (stream("/camera", hz=10, shift_ms=-37_200), LIDAR),
    "narrow": (SLOW_CAMERA, stream("/lidar", hz=5, shift_ms=21)),
    "unequal": (SLOW_CAMERA, stream("/lidar", hz=5, shift_ms=0.014)),
    "mixed": (SLOW_CAMERA, _in_turn(stream("/lidar", hz=5), stream("/lidar", hz=5, shift_ms=30))),
    "with_imu": (CAMERA, LIDAR, stream("/imu", hz=10, late_ms=3, shift_ms=-37)),
    "looped": (_looped(CAMERA), _looped(LIDAR)),
    "two_cameras": (CAMERA, LIDAR),
    "repeated": ([frame for frame in CAMERA for _ in range(2)], LIDAR),
    "cut_short": ([frame._replace(payload=frame.payload[:8]) for frame in CAMERA], LIDAR),
    "other_keys": (_keyed("/camera", "c"), _keyed("/lidar", "l")),
    "half_of_the_keys": (_keyed("/camera", "k"), _in_turn(_keyed("/lidar", "l"), _keyed("/lidar", "k"))),
    "drifting": (_drifting(stream("/camera", hz=20)), stream("/lidar", hz=20)),
}
OTHER_CAMERA = stream("/two_cameras/camera", hz=10, shift_ms=-350)
OPTIONS: dict[str, dict[str, Any]] = {
    "unequal": EXACT,
    "with_imu": {**APPROXIMATE, "max_wait": "100ms"},
    "other_keys": EQUAL_KEY,
    "half_of_the_keys": EQUAL_KEY,
    "drifting": {**APPROXIMATE, "slop": "1s"},
}


def _group(name: str) -> dict[str, Any]:
    rows = [
        {**row, "required": not row["topic"].endswith("/imu")}
        for row in inputs({f"/{name}{frames[0].topic}": VECTOR for frames in RIGS[name]})
    ]
    return {**OPTIONS.get(name, APPROXIMATE), "topics": rows}


@pytest.fixture(scope="module")
def relay(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Process]:
    """A relay of all rigs, which play on and on: one tells nothing that has to do with another."""
    with claimed_domain() as domain, running_stage(tmp_path_factory.mktemp("rigs"), domain) as stage:
        started = stage.relay(config({name: _group(name) for name in RIGS}, metrics=ANY_PORT))
        rigs = [
            [frame._replace(topic=f"/{name}{frame.topic}") for frame in frames]
            for name, streams in RIGS.items()
            for frames in streams
        ]
        usb_cam = stage.player({frames[0].topic: VECTOR for frames in rigs}, node="usb_cam")
        other_cam = stage.player({OTHER_CAMERA[0].topic: VECTOR}, node="other_cam")
        usb_cam.match()
        other_cam.match()
        usb_cam.start(merged(*rigs), speed=1)
        other_cam.start(OTHER_CAMERA, speed=1)
        yield started


def test_stamps_of_zero_are_told(relay: Process):
    assert_logged(
        relay,
        rf"unset: no set for {LASTED}: all \d+ messages of /unset/camera have stamp 0; have /usb_cam set header.stamp,"
        r" or write `stamp: receive` at /unset/camera\n",
    )


def test_a_camera_of_another_clock_is_told_with_its_offset(relay: Process):
    assert_logged(
        relay,
        rf"other_clock: no set for {LASTED}: stamps of /other_clock/camera are 37.2 s behind those of"
        r" /other_clock/lidar; synchronize the clocks of their machines, or write `offset: 37.\d+s` at"
        r" /other_clock/camera, which would give \d+ of \d+ possible sets\n",
    )


def test_a_slop_that_is_a_millisecond_too_small_is_told_with_one_that_fits(relay: Process):
    assert_logged(
        relay,
        rf"narrow: no set for {LASTED}: the nearest sets span 21 ms, over slop 20 ms; write `slop: 22ms`, which would"
        r" give (\d+) of \d+ possible sets \(now 0\), or, if both are measured at the same time,"
        r" `offset: (21ms` at /narrow/camera|-21ms` at /narrow/lidar), which would give \d+\n",
    )


def test_stamps_that_are_not_equal_are_told_to_exact_time(relay: Process):
    assert_logged(
        relay,
        rf"unequal: no set for {LASTED}: no stamps are equal: the nearest sets span 14 us; write"
        r" `policy: approximate_time` and `slop: 14us`, which would give \d+ of \d+ possible sets \(now 0\)\n",
    )


def test_some_sets_over_slop_are_a_warning(relay: Process):
    wait_for_finding(
        relay,
        "over_slop",
        "mixed",
        text=r"\d+ % of the last \d+ messages of /mixed/(camera|lidar) were farther from their partners than slop"
        r" 20 ms",
        suggestion=r"write `slop: (30|45)ms`, which would give \d+ of \d+ possible sets \(now \d+\)",
    )
    assert_logged(
        relay, r"\[WARN\] .* mixed: \d+ % of the last \d+ messages of /mixed/(camera|lidar) were farther from their"
    )


def test_an_optional_input_whose_stamps_fit_no_set_is_told_with_the_slop_that_would_do(relay: Process):
    wait_for_finding(
        relay,
        "waiting_for_optional",
        "with_imu",
        text=r"100 % of the sets leave without /with_imu/imu after waiting 100 ms for it: the nearest sets with it span"
        r" 37 ms to 37 ms, over slop 20 ms",
        suggestion=r"write `slop: 40ms`, which would give \d+ of \d+ sets with /with_imu/imu \(now 0\), or, if both are"
        r" measured at the same time, `offset: 37ms` at /with_imu/imu, which would give \d+",
    )
    assert_logged(
        relay, r"\[WARN\] .* with_imu: \d+ % of the sets leave without /with_imu/imu after waiting 100 ms for it: "
    )


def test_a_recording_that_is_looped_is_told_without_blame(relay: Process):
    finding = wait_for_finding(
        relay,
        "time_jump",
        "looped",
        text=rf"timestamps of /looped/(camera|lidar) jumped back 9.9 s, {LASTED} ago; matching restarted",
    )
    assert finding["severity"] == "ok"


def test_two_nodes_whose_stamps_conflict_on_one_topic_are_both_named(relay: Process):
    finding = wait_for_finding(
        relay,
        "several_publishers",
        "two_cameras",
        text=r"/\w+ and /\w+ both publish /two_cameras/camera: ((all|\d+ of the last) \d+ messages repeat a stamp or"
        rf" arrived out of stamp order|their stamps are {LASTED} apart)",
    )
    assert {"/usb_cam", "/other_cam"} <= set(re.findall(r"/\w+", finding["text"]))
    assert finding["suggestion"] == "give each publisher its own topic, or stop all but one"


def test_stamps_that_repeat_are_told(relay: Process):
    wait_for_finding(
        relay,
        "duplicates",
        "repeated",
        text=r"\d+ of the last \d+ messages of /repeated/camera repeat the stamp before them",
        suggestion="check how /usb_cam stamps its messages",
    )


def test_messages_that_are_cut_short_are_told(relay: Process):
    assert_logged(
        relay,
        rf"cut_short: no set for {LASTED}: all \d+ messages of /cut_short/camera are cut short, or not of its type;"
        r" check that /usb_cam uses the same version of geometry_msgs/msg/Vector3Stamped as is installed here\n",
    )


def test_inputs_without_a_common_key_are_told_with_their_keys(relay: Process):
    assert_logged(
        relay,
        rf"other_keys: no set for {LASTED}: no key arrived on all inputs while it was buffered; the newest are 'c\d+'"
        r" of /other_keys/camera, 'l\d+' of /other_keys/lidar; correct `key`",
    )


def test_far_fewer_sets_than_possible_are_told(relay: Process):
    wait_for_finding(
        relay,
        "few_sets",
        "half_of_the_keys",
        text=r"\d+ of \d+ possible sets left in the last [\d.]+ s; of the last \d+ messages of"
        r" /half_of_the_keys/(camera|lidar), .*",
    )


def test_a_drifting_clock_is_told_in_ppm(relay: Process):
    told = re.compile(
        r"stamps of /drifting/camera lose [\d.]+ ms a second against those of /drifting/lidar \(([\d.]+) ppm\)"
    )

    def is_near() -> bool:
        """Whether the figure, which what is late on its way disturbs for a while, is what was sent: 2000 ppm."""
        found = told.fullmatch(findings(relay, "drifting").get("clock_drift", {}).get("text", ""))
        return found is not None and 1500 < float(found[1]) < 2500

    wait_until(is_near, "a drift of 2000 ppm")
