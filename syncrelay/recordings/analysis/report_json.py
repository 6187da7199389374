"""An analysis for programs. All times and durations are nanoseconds, shares are of 1."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from syncrelay.explain.rows import Column, blocks
from syncrelay.recordings.analysis import Analysis, GroupAnalysis, Topic
from syncrelay.recordings.analysis.curves import Point
from syncrelay.recordings.analysis.topics import spread
from syncrelay.recordings.analysis.watching import LastingFinding
from syncrelay.recordings.bag import Recording


def as_json(name: str, analysis: Analysis) -> dict[str, Any]:
    """Return what json.dumps takes."""
    return {
        "recording": name,
        "begin": analysis.begin,
        "end": analysis.end,
        "faults": list(analysis.faults),
        "topics": [asdict(topic) for topic in analysis.topics],
        "groups": [_group(group) for group in analysis.groups],
    }


def inventory_as_json(name: str, recording: Recording, topics: Sequence[Topic]) -> dict[str, Any]:
    """Return what json.dumps takes, in the form of an analysis without groups; `unfit` as Topic has it."""
    return {
        "recording": name,
        "begin": recording.begin,
        "end": recording.end,
        "faults": recording.faults,
        "topics": [{**asdict(topic.figures), "unfit": topic.unfit} for topic in topics],
        "groups": [],
    }


def _group(each: GroupAnalysis) -> dict[str, Any]:
    return {
        "name": each.group.name,
        "policy": each.group.options.policy,
        "sets": len(each.evaluation.sets),
        "span": _quantity(each.evaluation.sets.spans),
        "latency": _quantity(each.evaluation.sets.latencies),
        "inputs": [
            {
                "topic": topic.topic,
                "received": counts.fed,
                "matched": counts.matched,
                "dropped": {reason.value: count for reason, count in counts.dropped.items()},
                "unneeded": fates.unneeded,
            }
            for topic, counts, fates in zip(each.group.topics, each.evaluation.counts, each.fates, strict=True)
        ],
        "mapped": [
            {
                "topic": mapped.topic,
                "offset": mapped.offset,
                "rate_ppm": mapped.rate_ppm,
                "restarts": [{"at": step.at, "by": step.by} for step in mapped.restarts],
                "delay": mapped.delay,
            }
            for mapped, _ in each.mapped
        ],
        "pairs": [
            {
                "first": pair.first,
                "second": pair.second,
                "signed": asdict(pair.signed),
                "distance": asdict(pair.distance),
            }
            for pair in each.pairs
        ],
        **_curves(each),
        "findings": [_finding(lasting) for lasting in each.findings],
        "suggestion": asdict(each.suggestion),
    }


def _quantity(values: Column) -> dict[str, Any] | None:
    """Return the spread of a quantity; None if there are no values."""
    return asdict(spread(lambda: blocks(values))) if len(values) else None


def _curves(each: GroupAnalysis) -> dict[str, Any]:
    """Return the curves; `matched` is the share of the slowest input's messages, of the `tried` ones."""
    curves = each.curves
    if curves is None:
        return {"by_slop": [], "by_queue_size": [], "tried": None}

    def point_of(key: str, point: Point) -> dict[str, Any]:
        return {key: point.value, "sets": point.sets, "matched": point.sets / max(1, curves.of)}

    return {
        "by_slop": [{**point_of("slop", each), "median_span": each.median_span} for each in curves.by_slop],
        "by_queue_size": [point_of("queue_size", each) for each in curves.by_queue_size],
        "tried": {"messages": curves.messages, "recorded": curves.recorded, "lasts": curves.lasts},
    }


def _finding(lasting: LastingFinding) -> dict[str, Any]:
    finding = lasting.finding
    return {
        "code": finding.code.value,
        "severity": finding.severity.name.lower(),
        "text": finding.text,
        "suggestion": finding.suggestion,
        "input": finding.input,
        "seconds": lasting.seconds,
    }
