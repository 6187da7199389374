"""What the script of the page draws for a group, and what the words beside it tell of that."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from syncrelay.config import GroupConfig
from syncrelay.recordings.analysis import Analysis, GroupAnalysis
from syncrelay.recordings.analysis.html.charts import Histogram, histogram, queue_marks, slop_marks
from syncrelay.recordings.analysis.html.lanes import Lanes, lanes_of
from syncrelay.recordings.analysis.html.packing import pack

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
