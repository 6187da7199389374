"""The state of a relay as JSON: what /status gives and `syncrelay top` reads."""

import os
from collections.abc import Mapping
from typing import Any, Final

from syncrelay import own_version
from syncrelay.config import Tolerance
from syncrelay.explain import (
    Distribution,
    DropFates,
    Endpoint,
    Finding,
    GroupFacts,
    GroupReport,
    RecentDrop,
    RecentSet,
    explanation,
)
from syncrelay.status.state import RelayState, is_ready, level
from syncrelay.sync import DropReason

_NS_PER_MS: Final = 1_000_000


def document(state: RelayState) -> dict[str, Any]:
    """Return the state as what json.dumps takes. Durations in milliseconds, stamps in nanoseconds.

    What is not known is null, as the type of an input for which the file has none and nobody publishes.
    """
    return {
        "relay": {
            "node": state.node,
            "version": own_version(),
            "config": state.config,
            "phase": state.phase.value,
            "ready": is_ready(state),
            "uptime_s": round(state.uptime_s, 1),
            "receives_by": state.receives_by,
            "reloads": state.reloads,
            "refused_reloads": state.refused_reloads,
            "reload_error": state.reload_error,
            "pid": os.getpid(),
        },
        "groups": [group_document(report) for report in state.groups],
    }


def group_document(report: GroupReport) -> dict[str, Any]:
    """Return what there is to say of a group as what json.dumps takes."""
    facts, figures = report.facts, report.facts.figures
    fates, lately = facts.fates, facts.fates_lately
    return {
        "name": facts.name,
        "policy": facts.policy,
        "level": level(report).value,
        "queue_size": facts.queue_size,
        "tolerance": _tolerance(facts.tolerance),
        "max_wait_ms": _ms(facts.max_wait),
        "sets": figures.sets,
        "rate_hz": round(figures.rate_hz, 3),
        "possible_hz": round(facts.possible_hz, 3),
        "since_last_set_ms": _ms(None if figures.last_set is None else figures.now - figures.last_set),
        "span_ms": _percentiles(figures.spans),
        "span_without_offsets_ms": _ms(report.span_without_offsets),
        "latency_ms": _percentiles(figures.latencies),
        "nearest_ms": _percentiles(figures.nearest),
        "last_sets": [{"span_ms": _ms(span), "latency_ms": _ms(late)} for span, late in reversed(figures.last_sets)],
        "inputs": [_input(facts, index, *each) for index, each in enumerate(zip(fates, lately, strict=True))],
        "findings": [_finding(facts, finding) for finding in _explanation_first(report.findings)],
        "recent": [_recent(outcome) for outcome in report.recent],
    }


def _tolerance(tolerance: Tolerance | None) -> dict[str, Any] | None:
    if tolerance is None or not tolerance.is_key:
        return None
    return {"key": tolerance.key, "ms": _ms(tolerance.ns)}


def _input(facts: GroupFacts, index: int, fates: DropFates, lately: DropFates) -> dict[str, Any]:
    each = facts.inputs[index]
    figures, counts = each.figures, each.counts
    return {
        "topic": each.name,
        "type": each.type,
        "output": each.output,
        "required": each.required,
        "offset_ms": _ms(each.offset),
        "rate_hz": round(figures.rate_hz, 3),
        "age_ms": _ms(None if figures.last_received is None else facts.figures.now - figures.last_received),
        "lag_ms": _ms(facts.lag(index)),
        "jitter_ms": _ms(figures.jitter),
        "drift_ppm": figures.drift and round(figures.drift.slope * 1e6, 1),
        "received": counts.fed,
        "matched": counts.matched,
        "buffered": counts.buffered,
        "dropped": _by_reason(counts.dropped),
        "unneeded": fates.unneeded,
        "other_drops": _by_reason(fates.others),
        "dropped_lately": _by_reason(figures.dropped),
        "unneeded_lately": lately.unneeded,
        "other_drops_lately": _by_reason(lately.others),
        "lost": each.graph.lost,
        "missing": round(facts.figures.missing[index], 3),
        "publishers": [_endpoint(publisher) for publisher in each.graph.publishers],
        "subscribers": [_endpoint(subscriber) for subscriber in each.graph.subscribers],
    }


def _by_reason(drops: Mapping[DropReason, int]) -> dict[str, int]:
    return {reason.value: count for reason, count in drops.items()}


def _endpoint(endpoint: Endpoint) -> dict[str, Any]:
    why = endpoint.mismatch
    mismatch = why and {"policy": why.policy, "offered": why.offered, "requested": why.requested}
    return {"node": endpoint.node, "type": endpoint.type, "mismatch": mismatch}


def _explanation_first(findings: tuple[Finding, ...]) -> list[Finding]:
    first = explanation(findings)
    return [first, *(finding for finding in findings if finding is not first)]


def _finding(facts: GroupFacts, finding: Finding) -> dict[str, Any]:
    return {
        "code": finding.code.value,
        "severity": finding.severity.name.lower(),
        "text": finding.text,
        "suggestion": finding.suggestion,
        "topic": None if finding.input is None else facts.inputs[finding.input].name,
        "topics": [facts.inputs[index].name for index in finding.about],
    }


def _recent(outcome: RecentSet | RecentDrop) -> dict[str, Any]:
    if isinstance(outcome, RecentSet):
        return {"set": list(outcome.stamps)}
    told = {"input": outcome.input, "stamp": outcome.stamp, "reason": outcome.reason.value}
    return {"drop": {**told, "unneeded": outcome.unneeded}}


def _percentiles(sample: Distribution) -> dict[str, float | None] | None:
    if not sample:
        return None
    return {"p50": _ms(sample.quantile(0.5)), "p95": _ms(sample.quantile(0.95)), "max": _ms(sample.quantile(1))}


def _ms(nanoseconds: int | None) -> float | None:
    return None if nanoseconds is None else round(nanoseconds / _NS_PER_MS, 3)
