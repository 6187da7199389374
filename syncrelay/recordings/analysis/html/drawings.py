"""What the script of the page draws for a group: lanes, histograms, curves; long rows of numbers are packed."""

import gzip
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from syncrelay.config import GroupConfig
from syncrelay.explain.rows import blocks
from syncrelay.recordings.analysis import Analysis, GroupAnalysis
from syncrelay.recordings.analysis.html.lanes import Lanes, lanes_of
from syncrelay.recordings.analysis.mappings import MappedInput, MappingCurve
from syncrelay.recordings.analysis.pairs import Pair
from syncrelay.recordings.bag.columns import Nanoseconds

_LARGEST: Final = 2**31 - 1
# With other stamps, the drawn distances are not those that suggested values are for.
_OTHER_STAMPS = ("stamp", "offset", "clock")
_BINS: Final = 60
# What lies so many times farther out than most do is counted, not drawn: it would press all others into one bar.
_FARTHEST: Final = 1.5
# Of the messages of a device, the farthest are not drawn: one that was held up for seconds.
_CUT_OFF: Final = 0.005
# A slop line so many times farther out than the offsets is left out for the same reason.
_FARTHEST_LINE: Final = 3


@dataclass(frozen=True, slots=True)
class Histogram:
    """How many offsets of a pair lie from one edge to the next, in nanoseconds, and how many outside of all."""

    edges: tuple[float, ...]
    counts: tuple[int, ...]
    outside: int


@dataclass(frozen=True, slots=True)
class Drawings:
    """A group's lanes, a histogram for each pair, and all that is drawn as the script wants it."""

    lanes: Lanes
    histograms: tuple[Histogram, ...]
    for_script: dict[str, Any]


def drawings_of(group: GroupAnalysis, analysis: Analysis, *, most: int) -> Drawings:
    """Return what is drawn of a group, with about `most` messages."""
    has_other_stamps = any(change.key in _OTHER_STAMPS for change in group.suggestion.changes)
    configs = (group.group, group.group if has_other_stamps else group.suggested)
    slops, sizes = [_slop(each) for each in configs], [each.options.queue_size for each in configs]
    lanes = lanes_of(group, analysis.begin, most=most)
    histograms = tuple(_histogram(pair, slops) for pair in group.pairs)
    return Drawings(
        lanes,
        histograms,
        {
            "name": group.group.name,
            "duration": analysis.end - analysis.begin,
            "timeline": _timeline(lanes),
            "slops": _marks(*slops),
            "sizes": _marks(*sizes),
            "mappings": [_mapping(mapped, curve, analysis.begin) for mapped, curve in group.mapped],
            "histograms": [{"edges": each.edges, "counts": each.counts} for each in histograms],
            **_curves(group),
        },
    )


def _mapping(mapped: MappedInput, curve: MappingCurve, begin: int) -> dict[str, Any]:
    """Return stamps, the line that they were mapped to, and where the clock was set; what lies far out is cut off."""
    heights = np.concatenate([curve.line, curve.stamps])
    low, high = (float(np.quantile(heights, share)) for share in (_CUT_OFF, 1 - _CUT_OFF))
    return {
        "times": pack(curve.times - begin),
        "stamps": pack(curve.stamps),
        "line": pack(curve.line),
        "begins": curve.begins,
        "between": (low, high),
        "steps": [(step.at - begin, step.by) for step in mapped.restarts],
    }


def _slop(group: GroupConfig) -> int | None:
    return None if group.options.matched_by or group.options.tolerance is None else group.options.tolerance.ns


def _marks(now: int | None, then: int | None) -> dict[str, int | None]:
    """Return the values that are marked in a chart: as they are in the file, and as they are suggested if different."""
    return {"now": now, "then": None if then == now else then}


def _histogram(pair: Pair, slops: Sequence[int | None]) -> Histogram:
    """Return how the offsets of a pair are spread, slops within what is drawn if they are not far out."""
    margin = round(_FARTHEST * (pair.signed.high - pair.signed.low))
    low = max(pair.signed.least, pair.signed.low - margin)
    high = min(pair.signed.greatest, pair.signed.high + margin)
    reach = max(abs(low), abs(high), 1)
    lines = [slop for slop in slops if slop is not None and slop <= _FARTHEST_LINE * reach]
    low, high = (min([low, *(-slop for slop in lines)]), max([high, *lines]))
    margin = max((high - low) // 20, 10)
    edges = np.linspace(low - margin, high + margin, _BINS + 1)
    counts = sum((np.histogram(some, edges)[0] for some in blocks(pair.offsets)), np.zeros(_BINS, dtype=np.int64))
    return Histogram(tuple(edges.tolist()), tuple(counts.tolist()), len(pair.offsets) - int(counts.sum()))


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
