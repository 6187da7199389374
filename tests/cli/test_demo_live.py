"""Frames as an 80x24 terminal shows them, from hand-written states."""

# ruff: noqa: RUF001  the marks are what they look like

import io

import pytest
from rich.console import Console

from syncrelay.cli.live import Moment, frame, ms
from syncrelay.cli.tally import GroupFigures, GroupPlan, Spans
from syncrelay.sync.messages import DropReason
from tests.cli.demo_states import MS, PLAN, a_drop, a_group, a_set, an_input

_OTHER_PLAN = GroupPlan(policy="approximate_time", slop=8 * MS, offsets=(0, 0))


def figures(state, *, plan=PLAN, sets_hz=9.5, best_hz=10.0, input_hz=(29.0, 10.0), spans=None):
    return GroupFigures(
        plan=plan, state=state, sets_hz=sets_hz, best_hz=best_hz, input_hz=input_hz, spans=spans, possible=0
    )


def camera_lidar():
    camera = an_input("/demo/camera/image_raw", fed=90, matched=28, dropped={DropReason.SUPERSEDED: 60})
    lidar = an_input("/demo/lidar/points", fed=30, matched=28, dropped={DropReason.TOO_FAR: 1})
    recent = [a_set(2000, 2003), a_drop(0, 2033), a_drop(0, 2067), a_set(2100, 2099)]
    recent.append(a_drop(1, 2200, DropReason.TOO_FAR))
    return figures(a_group(recent, inputs=[camera, lidar]), spans=Spans(2 * MS, 3 * MS, round(12.5 * MS)))


def lidar_imu():
    lidar = an_input("/demo/lidar/points", fed=30, matched=30)
    imu = an_input("/demo/imu/data", fed=300, matched=30, dropped={DropReason.SUPERSEDED: 260, DropReason.LATE: 2})
    state = a_group([a_set(2003, 2001), a_set(2099, 2101)], name="lidar_imu", inputs=[lidar, imu])
    return figures(state, plan=_OTHER_PLAN, sets_hz=10.0, input_hz=(10.0, 99.7), spans=Spans(2 * MS, 2 * MS, 2 * MS))


def moment(*groups, total_s=10.0):
    return Moment("syncrelay demo", groups, elapsed_s=3.04, total_s=total_s)


def shown(drawn, *, width=80, height=24, **options):
    file = io.StringIO()
    console = Console(file=file, width=width, height=height, _environ={}, **options)
    console.print(frame(drawn, width=width, height=height))
    return file.getvalue()


def test_two_groups_fill_an_80x24_terminal_and_no_more():
    assert [line.rstrip() for line in shown(moment(camera_lidar(), lidar_imu())).splitlines()] == [
        "syncrelay demo                                                        3.0 / 10 s",
        "",
        "camera_lidar   9.5 of 10.0 sets/s possible  ━━━━━━━━━━━━━━━━━━━━━━━━━╌ 95%",
        "  span 2 ms median, 3 ms p95, slop 10 ms; without offset 12.5 ms: over slop",
        "camera -12 ms ▏                                   A· · B",
        "              ▏                                   │   ╭╯",
        "        lidar ▏                                   A   B     ×",
        "   span in ms ▏                                  3.0 1.0",
        "       camera   29.0/s, 28 in sets, dropped: 60 superseded ·",
        "        lidar   10.0/s, 28 in sets, dropped: 1 too_far ×",
        "",
        "lidar_imu      10.0 of 10.0 sets/s possible  ━━━━━━━━━━━━━━━━━━━━━━━━━━ 100%",
        "  span 2 ms median, 2 ms p95, slop 8 ms",
        "        lidar ▏                                   A   B",
        "              ▏                                   │   ╰╮",
        "          imu ▏                                   A    B",
        "   span in ms ▏                                  2.0  2.0",
        "        lidar   10.0/s, 30 in sets, dropped: none",
        "          imu   99.7/s, 30 in sets, dropped: 260 superseded ·, 2 late <",
        "",
        "A B C  each letter is a set: messages matched by time and sent on together",
        "× too_far: nothing within slop   · superseded: a newer set left",
        "< late: older than the last set",
        "column 20 ms, strip 1.3 s, then again from the left; Ctrl-C ends it",
    ]


@pytest.mark.parametrize(("width", "height"), [(80, 24), (81, 25), (100, 30), (132, 43), (250, 80)])
def test_a_frame_fits_its_terminal(width, height):
    lines = shown(moment(camera_lidar(), lidar_imu()), width=width, height=height).splitlines()
    assert len(lines) <= height
    assert all(len(line) <= width for line in lines)


def test_a_low_terminal_loses_blank_lines_first():
    lines = shown(moment(camera_lidar(), lidar_imu()), height=22).splitlines()
    assert "" not in lines
    assert len(lines) == 21


def test_nothing_depends_on_colour():
    plain = shown(moment(camera_lidar(), lidar_imu()))
    coloured = shown(moment(camera_lidar(), lidar_imu()), force_terminal=True, color_system="256")
    assert "\x1b[" in coloured
    assert "\x1b[" not in plain


def test_no_color_is_honoured_and_weight_stays():
    file = io.StringIO()
    console = Console(file=file, width=80, force_terminal=True, color_system="256", _environ={"NO_COLOR": "1"})
    console.print(frame(moment(camera_lidar()), width=80, height=24))
    assert "38;5" not in file.getvalue()
    assert "48;5" not in file.getvalue()
    assert "\x1b[1m" in file.getvalue()


def test_before_the_first_set_a_group_says_what_it_waits_for():
    nobody = [an_input("/demo/camera/image_raw", publishers=0), an_input("/demo/lidar/points", publishers=0)]
    states = [a_group(inputs=nobody), a_group(waiting_for="the type x_msgs/msg/Y of /y"), a_group()]
    lines = shown(moment(*(figures(state, sets_hz=0.0, best_hz=0.0) for state in states)), height=40).splitlines()
    assert [line for line in lines if line.startswith("camera_lidar")] == [
        "camera_lidar   waiting for camera, lidar",
        "camera_lidar   waiting for the type x_msgs/msg/Y of /y",
        "camera_lidar   no set yet",
    ]
    assert lines[3] == "  approximate_time, slop 10 ms"


def test_more_sets_than_the_slowest_input_gave_in_the_window_are_no_more_than_all():
    early = figures(a_group([a_set(0, 0)]), sets_hz=10.5, best_hz=10.0)
    assert "━ 100%" in shown(moment(early))


def test_without_an_end_only_the_time_passed_is_shown():
    assert shown(moment(lidar_imu(), total_s=None)).splitlines()[0].endswith("  3.0 s")


@pytest.mark.parametrize(
    ("time", "text"), [(0, "0 ms"), (10 * MS, "10 ms"), (2_340_000, "2.3 ms"), (-12 * MS, "-12 ms")]
)
def test_times_are_written_in_milliseconds(time, text):
    assert ms(time) == text
