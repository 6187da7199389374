"""States of a relay with known counts and spans, through the real GroupWatch."""

from typing import Any

from syncrelay.config import load_text
from syncrelay.explain import Endpoint, GroupReport, GroupWatch, InputGraph, RecentDrop, judge
from syncrelay.status import Phase, RelayState
from syncrelay.sync.counts import InputCounts
from syncrelay.sync.messages import DropReason

S = 1_000_000_000
MS = 1_000_000
BEGAN = 1_700_000_000 * S
IMAGE = "sensor_msgs/msg/Image"
CAMERA = Endpoint("/usb_cam", IMAGE)
LIDAR = Endpoint("/ouster", IMAGE)
TEXT = f"""
version: 1
groups:
  front:
    policy: approximate_time
    slop: 20ms
    topics:
      - {{topic: /camera, type: {IMAGE}}}
      - {{topic: /lidar, type: {IMAGE}}}
"""


def started(*, camera: tuple[Endpoint, ...] = (CAMERA,), lidar: tuple[Endpoint, ...] = (LIDAR,)) -> GroupReport:
    """A group that has received nothing yet."""
    return _report(_watch(), now=BEGAN, camera=camera, lidar=lidar)


def working(*, camera: tuple[Endpoint, ...] = (CAMERA,), lidar: tuple[Endpoint, ...] = (LIDAR,)) -> GroupReport:
    """A group at 10 Hz for three seconds, whose sets span 5 ms and leave after 2 ms; some messages were dropped."""
    watch = _watch()
    for second in range(3):
        begin = BEGAN + second * S
        stamps = [begin + n * 100 * MS for n in range(10)]
        came = [[(each, each + MS) for each in stamps], [(each + 5 * MS, each + 7 * MS) for each in stamps]]
        sets = [((each, each + 5 * MS), 2 * MS) for each in stamps]
        n_sets = 10 * (second + 1)
        counts = (
            InputCounts(n_sets + 4, n_sets, {DropReason.LATE: 1, DropReason.TOO_FAR: 2}, 1),
            InputCounts(n_sets, n_sets, {}, 0),
        )
        watch.add(came, sets, counts, n_sets, now=begin + S)
    return _report(watch, now=BEGAN + 3 * S, camera=camera, lidar=lidar)


def relay(*groups: GroupReport, phase: Phase = Phase.RUNNING, turned_s: float = 0.1, reloads: int = 0) -> RelayState:
    return RelayState(
        node="/syncrelay",
        config="fusion.yaml",
        phase=phase,
        uptime_s=3.21,
        turned_s=turned_s,
        receives_by="rclpy",
        groups=groups,
        reloads=reloads,
    )


def _watch() -> GroupWatch:
    return GroupWatch(load_text(TEXT).groups[0], began=BEGAN)


def _report(watch: GroupWatch, *, now: int, **publishers: Any) -> GroupReport:
    graph = [
        InputGraph(f"/{name}", f"/front/{name}", publishers=publishers[name], subscribers=(Endpoint("/fusion", IMAGE),))
        for name in ("camera", "lidar")
    ]
    facts = watch.facts(graph, now=now)
    last = ((BEGAN, None), RecentDrop(0, BEGAN, DropReason.LATE))
    return GroupReport(facts, judge(facts), last)
