"""What the demo shows of its relay, on rigs in virtual time."""

import io
import re
from functools import cache

import pytest
from rich.console import Console

from syncrelay.cli.demo import shipped_config
from syncrelay.status.as_document import status_of
from syncrelay.top.demo_screen import frame, window_of
from syncrelay.top.plain import Moment, line_of, summary_of
from tests.top.rigs import Sensor, simulated

CAMERA, LIDAR, IMU = "/demo/camera/image_raw", "/demo/lidar/points", "/demo/imu/data"
RIG = {
    CAMERA: Sensor(30, lag_ms=8, jitter_ms=1, behind_ms=-12, publishers=("/camera",)),
    LIDAR: Sensor(10, lag_ms=31, jitter_ms=1, publishers=("/lidar",)),
    IMU: Sensor(100, lag_ms=2, jitter_ms=0.2, publishers=("/imu",)),
}


@cache
def moment(*without, seconds=12, total_s=20.0):
    """A moment of the demo, without some of its sensors."""
    state = simulated(
        shipped_config(), {topic: each for topic, each in RIG.items() if topic not in without}, seconds=seconds
    )
    now = state.groups[0].facts.figures.now + 300_000_000
    return Moment(status_of(state), seconds + 0.04, total_s, now)


def shown(drawn, *, width=80, height=24, environ=None, **options):
    file = io.StringIO()
    console = Console(file=file, width=width, height=height, _environ=environ or {}, **options)
    console.print(frame(drawn, width=width, height=height))
    return file.getvalue()


def test_two_groups_fill_an_80x24_terminal():
    lines = [line.rstrip() for line in shown(moment()).splitlines()]
    assert lines[0].startswith("syncrelay demo: camera, lidar and IMU simulated, relayed over DDS")
    assert lines[0].endswith("12.0 / 20 s")
    assert lines[1].startswith("── camera_lidar: approximate_time, slop 10 ms, queue_size 10 ──")
    assert lines[2].startswith("sets     10.1 of 10.1 possible a second ━")
    assert re.fullmatch(r"offset   -12 ms on /demo/camera/image_raw: span p50 .+, 1[12]\S* ms without it", lines[3])
    assert lines[4].startswith("camera -12 ms ▏")
    assert lines[6].startswith("        lidar ▏")
    assert re.search("[A-Z].*[A-Z]", lines[6])
    assert lines[7].startswith("   span in ms ▏")
    assert lines[9].startswith("/demo/camera/image_raw 30 Hz  ")
    assert lines[11].startswith("── lidar_imu: ")
    assert lines[19:] == [
        "/demo/imu/data     100 Hz    2.21 ms   549 us    " + lines[19][49:],
        "",
        "A B C  each letter is a set: messages matched by time and sent on together",
        "· not needed",
        "a column is 20 ms, the newest is on the right; Ctrl-C ends it",
    ]


@pytest.mark.parametrize("without", [(), (IMU,), (CAMERA, LIDAR, IMU)])
@pytest.mark.parametrize(("width", "height"), [(60, 15), (80, 24), (81, 25), (100, 30), (132, 43), (250, 80)])
def test_a_frame_fits_its_terminal(width, height, without):
    lines = shown(moment(*without), width=width, height=height).splitlines()
    assert len(lines) <= height
    assert all(len(line) <= width for line in lines)


def test_a_large_terminal_shows_findings_spans_and_latencies_too():
    text = shown(moment(), width=120, height=40)
    assert f"OK       {moment().state.groups[0].explanation.text}" in text
    assert text.count("\nlatency  ") == 2


def test_what_is_wrong_stands_in_place_of_the_rate():
    text = shown(moment(IMU))
    assert f"ERROR    {moment(IMU).state.groups[1].findings[0].text[:60]}" in text
    assert "── lidar_imu" in text
    assert "sets     10.1 of 10.1 possible" in text


def test_the_strip_moves_on_between_two_reports():
    one = moment()
    later = Moment(one.state, one.elapsed_s, one.total_s, one.now + 500_000_000)
    assert window_of(later, 80).head == window_of(one, 80).head + 500_000_000
    assert shown(one) != shown(later)


def test_the_strip_holds_no_more_than_a_report_and_stops_at_the_newest_message():
    one = moment()
    late = [Moment(one.state, one.elapsed_s, one.total_s, one.now + seconds * 1_000_000_000) for seconds in (5, 9)]
    first, second = (window_of(each, 250) for each in late)
    assert (first, first.width, first.column_ns) == (second, 65, 20_000_000)


def test_nothing_depends_on_colour():
    plain = shown(moment())
    coloured = shown(moment(), force_terminal=True, color_system="256")
    assert "\x1b[" not in plain
    assert re.sub(r"\x1b\[[\d;]*m", "", coloured) == plain


def test_no_color_is_honoured_and_weight_stays():
    text = shown(moment(), environ={"NO_COLOR": "1"}, force_terminal=True, color_system="256")
    assert "38;5" not in text
    assert "48;5" not in text
    assert "\x1b[1m" in text


def test_without_an_end_only_the_time_passed_is_shown():
    assert shown(moment(total_s=None)).splitlines()[0].endswith("  12.0 s")


def test_a_plain_line_holds_all_groups():
    assert re.fullmatch(
        r" 12\.0 s  camera_lidar: 10\.1 of 10\.1 possible sets a second, span \S+ [um]s; lidar_imu: .*/demo/imu/data.*",
        line_of(moment(IMU)),
    )


def test_before_the_first_set_a_plain_line_says_so():
    drawn = moment(CAMERA, LIDAR, IMU, seconds=0)
    assert line_of(drawn).endswith(f"lidar_imu: {drawn.state.groups[1].findings[0].text}")


def test_the_summary_says_what_became_of_every_message_and_what_was_found():
    lines = summary_of(moment(IMU)).splitlines()
    assert lines[0] == "syncrelay demo: camera, lidar and IMU simulated, relayed over DDS: 12.0 s"
    assert "camera_lidar: OK, 10.1 of 10.1 possible sets a second, 120 sets, last just now" in lines
    assert "lidar_imu: ERROR, 0 of 0 possible sets a second, no set yet" in lines
    assert f"  ERROR: {moment(IMU).state.groups[1].findings[0].text}" in lines
    counted = re.search(
        r"(\d+) received, (\d+) in sets, (\d+) waiting, (\d+) not needed, (\d+) dropped", "\n".join(lines)
    )
    assert counted is not None
    received, *fates = map(int, counted.groups())
    assert received == sum(fates) == 360
