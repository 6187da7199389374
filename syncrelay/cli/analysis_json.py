"""An analysis for programs. All times and durations are nanoseconds, shares are of 1."""

from dataclasses import asdict
from typing import Any, Final

from syncrelay.bag.analysis import Analysis, GroupAnalysis
from syncrelay.bag.analysis.curves import queue_curve, slop_curve
from syncrelay.bag.analysis.nearest import Pair
from syncrelay.bag.analysis.trial import LastingFinding

_SHARES: Final = (*(step / 40 for step in range(1, 40)), 0.99, 0.995, 1.0)


def as_json(name: str, analysis: Analysis) -> dict[str, Any]:
    """Return what json.dumps takes."""
    return {
        "recording": name,
        "begin": analysis.begin,
        "end": analysis.end,
        "topics": [asdict(topic) for topic in analysis.topics],
        "groups": [_group(group) for group in analysis.groups],
    }


def _group(each: GroupAnalysis) -> dict[str, Any]:
    suggestion = each.suggestion
    return {
        "name": each.group.name,
        "policy": each.group.options.policy,
        "sets": len(each.trial.sets),
        "inputs": [
            {
                "topic": topic.topic,
                "received": counts.fed,
                "matched": counts.matched,
                "dropped": {reason.value: count for reason, count in counts.dropped.items()},
            }
            for topic, counts in zip(each.group.topics, each.trial.counts, strict=True)
        ],
        "pairs": [_pair(pair) for pair in each.pairs],
        **_curves(each),
        "findings": [_finding(lasting) for lasting in each.findings],
        "suggestion": {
            "possible": suggestion.possible,
            "now": suggestion.now,
            "then": suggestion.then,
            "hints": suggestion.hints,
            "changes": [asdict(change) for change in suggestion.changes],
        },
    }


def _pair(pair: Pair) -> dict[str, Any]:
    return {
        "first": pair.first,
        "second": pair.second,
        "signed": asdict(pair.signed),
        "distance": asdict(pair.distance),
    }


def _curves(each: GroupAnalysis) -> dict[str, Any]:
    found = each.tightest
    if found is None:
        return {"by_slop": [], "by_queue_size": []}
    tolerance = each.group.options.tolerance
    points = slop_curve(found, marks=(tolerance.ns,) if tolerance and tolerance.ns else (), shares=_SHARES)
    sizes = queue_curve(found, each.slop, marks=(each.group.options.queue_size,), shares=_SHARES)
    return {
        "by_slop": [{"slop": at, "matched": share, "median_span": span} for at, share, span in points],
        "by_queue_size": [{"queue_size": size, "matched": share} for size, share in sizes],
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
