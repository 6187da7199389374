"""What the script of the page draws for a group, and what the words beside it tell of that."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from syncrelay.bag.analysis import Analysis, GroupAnalysis
from syncrelay.bag.analysis.analysis import group_of
from syncrelay.bag.analysis.changes import with_changes
from syncrelay.cli.analysis_html.charts import (
    Histogram,
    Marks,
    by_queue_size,
    by_slop,
    histogram,
    queue_marks,
    slop_marks,
)
from syncrelay.cli.analysis_html.lanes import Lanes, lanes_of
from syncrelay.cli.analysis_html.packing import pack
from syncrelay.config import GroupConfig

# With other stamps, the drawn distances are not those that suggested values are for.
_OTHER_STAMPS = ("stamp", "offset")


@dataclass(frozen=True, slots=True)
class Drawings:
    """A group's lanes, a histogram for each pair, the marks in its curves, and all of it as the script wants it."""

    lanes: Lanes
    histograms: tuple[Histogram, ...]
    slops: Marks
    sizes: Marks
    for_script: dict[str, Any]


def drawings_of(group: GroupAnalysis, analysis: Analysis, *, most: int) -> Drawings:
    """Return what is drawn of a group, with about `most` messages."""
    suggested = _suggested(group, analysis.text)
    slops, sizes = slop_marks(group.group, suggested), queue_marks(group.group, suggested)
    lanes = lanes_of(group, analysis.begin, most=most)
    histograms = tuple(histogram(pair, slops) for pair in group.pairs)
    return Drawings(
        lanes,
        histograms,
        slops,
        sizes,
        {
            "name": group.group.name,
            "duration": analysis.end - analysis.begin,
            "timeline": _timeline(lanes),
            "slops": {"now": slops.now, "then": slops.then},
            "sizes": {"now": sizes.now, "then": sizes.then},
            "histograms": [{"edges": each.edges, "counts": each.counts} for each in histograms],
            "by_slop": by_slop(group, slops),
            "by_queue_size": by_queue_size(group, sizes),
        },
    )


def _suggested(group: GroupAnalysis, text: str) -> GroupConfig:
    changes = group.suggestion.changes
    if not changes or any(change.key in _OTHER_STAMPS for change in changes):
        return group.group
    return group_of(with_changes(text, changes), group.group.name)


def _timeline(lanes: Lanes) -> dict[str, Any]:
    return {
        "lanes": [{"topic": lane.topic, "times": pack(lane.times), "fates": pack(lane.fates)} for lane in lanes.lanes],
        "members": [pack(column) for column in np.ascontiguousarray(lanes.members.T)],
        "spans": pack(lanes.spans),
        "latencies": pack(lanes.latencies),
        "each": lanes.each,
        "stretch": lanes.stretch,
    }
