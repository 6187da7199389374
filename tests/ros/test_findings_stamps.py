"""A working rig whose stamps are broken in every way that the relay has a word for."""

import re

import pytest

from tests.ros.cdr_messages import VECTOR, vector, with_stamp
from tests.ros.configs import config, inputs
from tests.ros.frames import Frame
from tests.ros.processes import wait_until
from tests.ros.sensors import LASTED, PAIR, assert_logged, front, play, stream
from tests.ros.stage import Stage
from tests.ros.status import ANY_PORT, findings, wait_for_finding
from tests.ros.streams import BEGIN, MS, merged

pytestmark = pytest.mark.ros


def test_stamps_of_zero_are_told(stage: Stage):
    relay = stage.relay(front())
    unset = [frame._replace(payload=with_stamp(frame.payload, 0)) for frame in stream("/camera", hz=10)]
    play(stage, merged(unset, stream("/lidar", hz=10)), node="usb_cam")
    assert_logged(
        relay,
        rf"no set for {LASTED}: all \d+ messages of /camera have stamp 0; have /usb_cam set header.stamp, or write"
        r" `stamp: receive` at /camera\n",
    )


def test_a_camera_of_another_clock_is_told_with_its_offset(stage: Stage):
    relay = stage.relay(front())
    play(stage, merged(stream("/camera", hz=10, shift_ms=-37_200), stream("/lidar", hz=10)))
    assert_logged(
        relay,
        rf"no set for {LASTED}: stamps of /camera are 37.2 s behind those of /lidar; synchronize the clocks of their"
        r" machines, or write `offset: 37.\d+s` at /camera, which would give \d+ of \d+ possible sets\n",
    )


def test_a_slop_that_is_a_millisecond_too_small_is_told_with_one_that_fits(stage: Stage):
    relay = stage.relay(front())
    play(stage, merged(stream("/camera", hz=5), stream("/lidar", hz=5, shift_ms=21)))
    assert_logged(
        relay,
        rf"no set for {LASTED}: the nearest sets span 21 ms, over slop 20 ms; write `slop: 22ms`, which would give"
        r" (\d+) of \d+ possible sets \(now 0\), or, if both are measured at the same time,"
        r" `offset: (21ms` at /camera|-21ms` at /lidar), which would give \d+\n",
    )


def test_stamps_that_are_not_equal_are_told_to_exact_time(stage: Stage):
    text = config({"front": {"policy": "exact_time", "topics": inputs(PAIR)}}, metrics=ANY_PORT)
    relay = stage.relay(text)
    play(stage, merged(stream("/camera", hz=5), stream("/lidar", hz=5, shift_ms=0.014)))
    assert_logged(
        relay,
        rf"no set for {LASTED}: no stamps are equal: the nearest sets span 14 us; write `policy: approximate_time` and"
        r" `slop: 14us`, which would give \d+ of \d+ possible sets \(now 0\)\n",
    )


def test_some_sets_over_slop_are_a_warning(stage: Stage):
    relay = stage.relay(front())
    near, far = stream("/lidar", hz=5), stream("/lidar", hz=5, shift_ms=30)
    mixed = [pair[n % 2] for n, pair in enumerate(zip(near, far, strict=True))]
    play(stage, merged(stream("/camera", hz=5), mixed))
    wait_for_finding(
        relay,
        "over_slop",
        text=r"\d+ % of the last \d+ messages of /(camera|lidar) were farther from their partners than slop 20 ms",
        suggestion=r"write `slop: (30|45)ms`, which would give \d+ of \d+ possible sets \(now \d+\)",
    )
    assert_logged(
        relay, r"\[WARN\] .* front: \d+ % of the last \d+ messages of /(camera|lidar) were farther from their"
    )


def test_an_optional_input_whose_stamps_fit_no_set_is_told_with_the_slop_that_would_do(stage: Stage):
    topics = [*inputs(PAIR), *inputs({"/imu": VECTOR}, required=False)]
    relay = stage.relay(front(topics, max_wait="100ms"))
    play(
        stage, merged(stream("/camera", hz=10), stream("/lidar", hz=10), stream("/imu", hz=10, late_ms=3, shift_ms=-37))
    )
    wait_for_finding(
        relay,
        "waiting_for_optional",
        text=r"100 % of the sets leave without /imu after waiting 100 ms for it: the nearest sets with it span 37 ms to"
        r" 37 ms, over slop 20 ms",
        suggestion=r"write `slop: 40ms`, which would give \d+ of \d+ sets with /imu \(now 0\), or, if both are measured"
        r" at the same time, `offset: 37ms` at /imu, which would give \d+",
    )
    assert_logged(relay, r"\[WARN\] .* front: \d+ % of the sets leave without /imu after waiting 100 ms for it: ")


def test_a_recording_that_is_looped_is_told_without_blame(stage: Stage):
    relay = stage.relay(front())
    recording = merged(stream("/camera", hz=10, last_ms=3000), stream("/lidar", hz=10, last_ms=3000))
    player = stage.player(PAIR)
    player.match()
    for _ in range(2):
        player.play(recording, speed=1)
    finding = wait_for_finding(
        relay,
        "time_jump",
        text=rf"timestamps of /(camera|lidar) jumped back 2.9 s, {LASTED} ago; matching restarted",
    )
    assert finding["severity"] == "ok"


def test_two_nodes_whose_stamps_conflict_on_one_topic_are_both_named(stage: Stage):
    relay = stage.relay(front())
    usb_cam, other_cam = stage.player(PAIR, node="usb_cam"), stage.player({"/camera": VECTOR}, node="other_cam")
    usb_cam.match()
    other_cam.match()
    usb_cam.start(merged(stream("/camera", hz=10), stream("/lidar", hz=10)), speed=1)
    other_cam.start(stream("/camera", hz=10, shift_ms=-350), speed=1)
    finding = wait_for_finding(
        relay,
        "several_publishers",
        text=r"/\w+ and /\w+ both publish /camera: ((all|\d+ of the last) \d+ messages repeat a stamp or arrived out of"
        rf" stamp order|their stamps are {LASTED} apart)",
    )
    assert {"/usb_cam", "/other_cam"} <= set(re.findall(r"/\w+", finding["text"]))
    assert finding["suggestion"] == "give each publisher its own topic, or stop all but one"


def test_stamps_that_repeat_are_told(stage: Stage):
    relay = stage.relay(front())
    twice = [frame for frame in stream("/camera", hz=10) for _ in range(2)]
    play(stage, merged(twice, stream("/lidar", hz=10)), node="usb_cam")
    wait_for_finding(
        relay,
        "duplicates",
        text=r"\d+ of the last \d+ messages of /camera repeat the stamp before them",
        suggestion="check how /usb_cam stamps its messages",
    )


def test_messages_that_are_cut_short_are_told(stage: Stage):
    relay = stage.relay(front())
    short = [frame._replace(payload=frame.payload[:8]) for frame in stream("/camera", hz=10)]
    play(stage, merged(short, stream("/lidar", hz=10)), node="usb_cam")
    assert_logged(
        relay,
        rf"no set for {LASTED}: all \d+ messages of /camera are cut short, or not of its type; check that /usb_cam uses"
        r" the same version of geometry_msgs/msg/Vector3Stamped as is installed here\n",
    )


def _keyed(topic: str, key: str, *, hz: float = 10) -> list[Frame]:
    """Messages whose frame_id is the key and a running number."""
    return [
        frame._replace(payload=vector(BEGIN + n * MS, frame_id=f"{key}{n}"))
        for n, frame in enumerate(stream(topic, hz=hz))
    ]


EQUAL_KEY = {"policy": "equal_key", "key": "header.frame_id"}


def test_inputs_without_a_common_key_are_told_with_their_keys(stage: Stage):
    text = config({"front": {**EQUAL_KEY, "topics": inputs(PAIR)}}, metrics=ANY_PORT)
    relay = stage.relay(text)
    play(stage, merged(_keyed("/camera", "c"), _keyed("/lidar", "l")))
    assert_logged(
        relay,
        rf"no set for {LASTED}: no key arrived on all inputs while it was buffered; the newest are 'c\d+' of /camera,"
        r" 'l\d+' of /lidar; correct `key`",
    )


def test_far_fewer_sets_than_possible_are_told(stage: Stage):
    text = config({"front": {**EQUAL_KEY, "topics": inputs(PAIR)}}, metrics=ANY_PORT)
    relay = stage.relay(text)
    half = [pair[n % 2] for n, pair in enumerate(zip(_keyed("/lidar", "l"), _keyed("/lidar", "k"), strict=True))]
    play(stage, merged(_keyed("/camera", "k"), half))
    wait_for_finding(
        relay,
        "few_sets",
        text=r"[\d.]+ of [\d.]+ possible sets leave per second; of the last \d+ messages of /(camera|lidar), .*",
    )


def test_a_drifting_clock_is_told_in_ppm(stage: Stage):
    relay = stage.relay(front(slop="1s"))
    drifting = [
        frame._replace(payload=vector(BEGIN + round((frame.time - BEGIN) * 0.998)))
        for frame in stream("/camera", hz=20)
    ]
    play(stage, merged(drifting, stream("/lidar", hz=20)))
    told = re.compile(r"stamps of /camera lose [\d.]+ ms a second against those of /lidar \(([\d.]+) ppm\)")

    def is_near() -> bool:
        """Whether the figure, which what is late on its way disturbs for a while, is what was sent: 2000 ppm."""
        found = told.fullmatch(findings(relay).get("clock_drift", {}).get("text", ""))
        return found is not None and 1500 < float(found[1]) < 2500

    wait_until(is_near, "a drift of 2000 ppm")
