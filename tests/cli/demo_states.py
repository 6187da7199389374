"""Hand-written states of a relay, as short as the cases that need them."""

from collections.abc import Mapping, Sequence

from syncrelay.cli.tally import GroupPlan
from syncrelay.explain import RecentDrop, RecentSet
from syncrelay.ros.snapshot import GroupSnapshot, InputSnapshot
from syncrelay.sync.counts import InputCounts
from syncrelay.sync.messages import DropReason

MS = 1_000_000
PLAN = GroupPlan(policy="approximate_time", slop=10 * MS, offsets=(-12 * MS, 0))


def an_input(
    topic: str, *, fed: int = 0, matched: int = 0, dropped: Mapping[DropReason, int] | None = None, publishers: int = 1
) -> InputSnapshot:
    counts = InputCounts(fed=fed, matched=matched, dropped=dropped or {}, buffered=0)
    return InputSnapshot(topic=topic, output=f"/out{topic}", counts=counts, publishers=publishers, subscribed=True)


def a_group(
    recent: Sequence[RecentSet | RecentDrop] = (),
    *,
    name: str = "camera_lidar",
    inputs: Sequence[InputSnapshot] | None = None,
    sets: int | None = None,
    waiting_for: str | None = None,
) -> GroupSnapshot:
    """A group of camera and lidar that has given just its recent sets, unless said otherwise."""
    counted = sum(isinstance(outcome, RecentSet) for outcome in recent)
    return GroupSnapshot(
        name=name,
        inputs=tuple(inputs or (an_input("/demo/camera/image_raw"), an_input("/demo/lidar/points"))),
        sets=counted if sets is None else sets,
        recent=tuple(recent),
        waiting_for=waiting_for,
    )


def a_set(*stamps_ms: float | None) -> RecentSet:
    return RecentSet(tuple(None if stamp is None else round(stamp * MS) for stamp in stamps_ms))


def a_drop(lane: int, stamp_ms: float, reason: DropReason = DropReason.SUPERSEDED) -> RecentDrop:
    return RecentDrop(lane, round(stamp_ms * MS), reason)
