"""What the script of the page draws for a group, with long rows of whole numbers packed into few characters."""

import gzip
from base64 import b64encode
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from syncrelay.config import GroupConfig
from syncrelay.recordings.analysis import Analysis, GroupAnalysis
from syncrelay.recordings.analysis.html.charts import Histogram, histogram, queue_marks, slop_marks
from syncrelay.recordings.analysis.html.lanes import Lanes, lanes_of
from syncrelay.recordings.bag.columns import Nanoseconds

_LARGEST: Final = 2**31 - 1
# With other stamps, the drawn distances are not those that suggested values are for.
_OTHER_STAMPS = ("stamp", "offset")


@dataclass(frozen=True, slots=True)
class Drawings:
    """A group's lanes, a histogram for each pair, and all that is drawn as the script wants it."""

    lanes: Lanes
    histograms: tuple[Histogram, ...]
    for_script: dict[str, Any]


def drawings_of(group: GroupAnalysis, analysis: Analysis, *, most: int) -> Drawings:
    """Return what is drawn of a group, with about `most` messages."""
    suggested = _suggested(group)
    slops, sizes = slop_marks(group.group, suggested), queue_marks(group.group, suggested)
    lanes = lanes_of(group, analysis.begin, most=most)
    histograms = tuple(histogram(pair, slops) for pair in group.pairs)
    return Drawings(
        lanes,
        histograms,
        {
            "name": group.group.name,
            "duration": analysis.end - analysis.begin,
            "timeline": _timeline(lanes),
            "slops": {"now": slops.now, "then": slops.then},
            "sizes": {"now": sizes.now, "then": sizes.then},
            "histograms": [{"edges": each.edges, "counts": each.counts} for each in histograms],
            **_curves(group),
        },
    )


def _suggested(group: GroupAnalysis) -> GroupConfig:
    has_other_stamps = any(change.key in _OTHER_STAMPS for change in group.suggestion.changes)
    return group.group if has_other_stamps else group.suggested


def _curves(group: GroupAnalysis) -> dict[str, Any]:
    curves = group.curves
    if curves is None:
        return {"by_slop": [], "by_queue_size": []}
    return {
        "by_slop": [(point.value, point.sets, point.median_span) for point in curves.by_slop],
        "by_queue_size": [(point.value, point.sets) for point in curves.by_queue_size],
    }


def _timeline(lanes: Lanes) -> dict[str, Any]:
    return {
        "lanes": [{"topic": lane.topic, "times": pack(lane.times), "fates": pack(lane.fates)} for lane in lanes.lanes],
        "members": [pack(column) for column in np.ascontiguousarray(lanes.members.T)],
        "spans": pack(lanes.spans),
        "latencies": pack(lanes.latencies),
        "each": lanes.each,
        "stretch": lanes.stretch,
    }


def pack(values: Nanoseconds) -> dict[str, Any]:
    """Return how many numbers there are, their unit, and the steps from each to the next.

    The unit is 1, or the least power of ten in which each step fits 32 bits. `steps` is base64 of gzip of the lowest
    bytes of all steps, then of the next, up to the highest, as equal bytes compress best side by side.
    """
    unit = 1
    steps = np.diff(values, prepend=np.int64(0))
    while len(steps) and int(np.max(np.abs(steps))) > _LARGEST:
        unit *= 10
        steps = np.diff(values // unit, prepend=np.int64(0))
    planes = steps.astype("<i4").view(np.uint8).reshape(-1, 4).T
    # gzip's time is left out, so that the same recording makes the same file.
    packed = gzip.compress(planes.tobytes(), mtime=0)
    return {"count": len(values), "unit": unit, "steps": b64encode(packed).decode("ascii")}
