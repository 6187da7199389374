import io

from rich.console import Console

from syncrelay.cli.digest import plain_line, summary
from syncrelay.cli.live import Moment
from syncrelay.cli.tally import GroupFigures, GroupPlan, Spans
from syncrelay.sync.messages import DropReason
from tests.cli.demo_states import MS, PLAN, a_group, an_input

_OTHER_PLAN = GroupPlan(policy="approximate_time", slop=8 * MS, offsets=(0, 0))
_DROPS = {DropReason.SHUTDOWN: 2, DropReason.TOO_FAR: 3, DropReason.SUPERSEDED: 200}


def camera_lidar(*, publishers=1):
    camera = an_input("/demo/camera/image_raw", fed=290, matched=87, dropped=_DROPS, publishers=publishers)
    lidar = an_input("/demo/lidar/points", fed=97, matched=87)
    state = a_group(inputs=[camera, lidar], sets=87)
    return GroupFigures(PLAN, state, 9.0, 9.8, (29.0, 9.8), Spans(700_000, 2_500_000, 12 * MS), 97)


def lidar_imu_waiting():
    inputs = [an_input("/demo/lidar/points"), an_input("/demo/imu/data", publishers=0)]
    state = a_group(name="lidar_imu", inputs=inputs)
    return GroupFigures(_OTHER_PLAN, state, 0.0, 0.0, (0.0, 0.0), None, 0)


def moment(*groups):
    return Moment("syncrelay demo", groups, elapsed_s=10.02, total_s=10.0)


def text_of(renderable):
    file = io.StringIO()
    Console(file=file, width=80, _environ={}).print(renderable)
    return [line.rstrip() for line in file.getvalue().splitlines()]


def test_the_summary_says_what_became_of_everything():
    assert text_of(summary(moment(camera_lidar(), lidar_imu_waiting()))) == [
        "syncrelay demo: 10.0 s",
        "",
        "group         sets  possible         span     p95   slop",
        "camera_lidar    87        97  90%  0.7 ms  2.5 ms  10 ms",
        "lidar_imu        0         0                        8 ms",
        "",
        "group         input   received  in sets  dropped",
        "camera_lidar  camera       290       87  200 superseded, 3 too_far,",
        "                                         2 shutdown",
        "              lidar         97       87",
        "lidar_imu     lidar          0        0",
        "              imu            0        0",
        "",
        "camera_lidar: offset -12 ms on camera. Without it, the span of these sets would",
        "be 12 ms, more than slop allows.",
    ]


def test_a_second_rig_on_the_same_topics_is_named():
    lines = text_of(summary(moment(camera_lidar(publishers=2))))
    assert lines[-2:] == [
        "/demo/camera/image_raw has 2 publishers: another demo runs, and its messages are",
        "counted here.",
    ]


def test_a_plain_line_holds_all_groups():
    assert plain_line(moment(camera_lidar(), lidar_imu_waiting())) == (
        " 10.0 s  camera_lidar 9.0 of 9.8 sets/s, span 0.7 ms; lidar_imu waits for imu"
    )
