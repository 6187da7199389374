"""The document of a relay's state. Imported when the status is first asked for: its models take time to make."""

import os
from collections.abc import Mapping
from typing import Final

from syncrelay import own_version
from syncrelay.config import Tolerance
from syncrelay.explain import (
    Distribution,
    DropFates,
    Endpoint,
    Finding,
    GroupFacts,
    GroupReport,
    Mismatch,
    Sender,
    Trouble,
    explanation,
    troubles,
)
from syncrelay.status import document
from syncrelay.status.headline import headline
from syncrelay.status.state import Level, RelayState, is_ready, level
from syncrelay.sync import DropReason

_NS_PER_MS: Final = 1_000_000


def status_of(state: RelayState) -> document.Status:
    """Return the status of a relay."""
    relay = document.Relay(
        node=state.node,
        version=own_version(),
        config=state.config,
        phase=state.phase,
        ready=is_ready(state),
        uptime_s=round(state.uptime_s, 1),
        receives_by=state.receives_by,
        reloads=state.reloads,
        refused_reloads=state.refused_reloads,
        reload_error=state.reload_error,
        pid=os.getpid(),
    )
    groups = tuple(map(group_of, state.groups))
    found = [(report.facts, report.problems) for report in state.groups]
    return document.Status(
        relay=relay,
        headline=headline(state.phase, groups),
        troubles=tuple(map(_trouble, troubles(found, state.published_by))),
        groups=groups,
    )


def _trouble(found: Trouble) -> document.Trouble:
    return document.Trouble(
        code=found.code.value,
        severity=Level(found.severity.name.lower()),
        text=found.text,
        suggestion=found.suggestion,
        groups=found.groups,
    )


def group_of(report: GroupReport) -> document.Group:
    """Return what the status of a relay says of a group."""
    facts, figures = report.facts, report.facts.figures
    fates = zip(facts.fates, facts.fates_lately, strict=True)
    first = explanation(report.findings)
    findings = (first, *(finding for finding in report.findings if finding is not first))
    return document.Group(
        name=facts.name,
        policy=facts.policy,
        level=level(report),
        queue_size=facts.queue_size,
        tolerance=_tolerance(facts.tolerance),
        max_wait_ms=_ms(facts.max_wait),
        bundle=None if facts.bundle is None else facts.bundle.name,
        sets=figures.sets,
        rate_hz=round(figures.rate_hz, 3),
        possible_hz=round(facts.possible_hz, 3),
        since_last_set_ms=None if figures.last_set is None else _in_ms(figures.now - figures.last_set),
        span_ms=_percentiles(figures.spans),
        span_without_offsets_ms=_ms(report.span_without_offsets),
        latency_ms=_percentiles(figures.latencies),
        nearest_ms=_percentiles(figures.nearest),
        last_sets=tuple(
            document.SetFigures(span_ms=_in_ms(span), latency_ms=_in_ms(latency))
            for span, latency in reversed(figures.last_sets)
        ),
        inputs=tuple(_input(facts, index, *each) for index, each in enumerate(fates)),
        findings=tuple(_finding(facts, finding) for finding in findings),
        recent=report.recent,
    )


def _tolerance(tolerance: Tolerance | None) -> document.Tolerance | None:
    if tolerance is None or not tolerance.is_key:
        return None
    return document.Tolerance(key=tolerance.key, ms=_in_ms(tolerance.ns))


def _input(facts: GroupFacts, index: int, fates: DropFates, lately: DropFates) -> document.Input:
    each = facts.inputs[index]
    figures, counts = each.figures, each.counts
    return document.Input(
        topic=each.name,
        type=each.type,
        output=each.output,
        required=each.required or each.in_quorum,
        offset_ms=_in_ms(each.offset),
        rate_hz=round(figures.rate_hz, 3),
        age_ms=None if figures.last_received is None else _in_ms(facts.figures.now - figures.last_received),
        lag_ms=_ms(facts.lag(index)),
        jitter_ms=_ms(figures.jitter),
        drift_ppm=figures.drift and round(figures.drift.slope * 1e6, 1),
        received=counts.fed,
        matched=counts.matched,
        buffered=counts.buffered,
        dropped=_by_reason(counts.dropped),
        unneeded=fates.unneeded,
        other_drops=_by_reason(fates.others),
        dropped_lately=_by_reason(figures.dropped),
        unneeded_lately=lately.unneeded,
        other_drops_lately=_by_reason(lately.others),
        lost=each.graph.undelivered,
        missing=round(facts.figures.missing[index], 3),
        publishers=tuple(map(_endpoint, each.graph.publishers)),
        senders=tuple(_sender(sender) for sender in each.graph.senders if sender.sent),
        subscribers=tuple(map(_endpoint, each.graph.subscribers)),
    )


def _by_reason(drops: Mapping[DropReason, int]) -> dict[str, int]:
    return {reason.value: count for reason, count in drops.items()}


def _endpoint(endpoint: Endpoint) -> document.Endpoint:
    return document.Endpoint(node=endpoint.node, type=endpoint.type, mismatch=_mismatch(endpoint.mismatch))


def _sender(sender: Sender) -> document.Sender:
    return document.Sender(
        node=sender.node,
        sent=sender.sent,
        delivered=sender.delivered,
        lost=sender.lost,
        sent_hz=sender.sent_hz and round(sender.sent_hz, 3),
        way_ms=_ms(sender.way),
    )


def _mismatch(why: Mismatch | None) -> document.Mismatch | None:
    if why is None:
        return None
    return document.Mismatch(policy=why.policy, offered=why.offered, requested=why.requested)


def _finding(facts: GroupFacts, finding: Finding) -> document.Finding:
    return document.Finding(
        code=finding.code.value,
        severity=Level(finding.severity.name.lower()),
        text=finding.text,
        suggestion=finding.suggestion,
        topic=None if finding.input is None else facts.inputs[finding.input].name,
        topics=tuple(facts.inputs[index].name for index in finding.about),
    )


def _percentiles(sample: Distribution) -> document.Percentiles | None:
    if not sample:
        return None
    p50, p95, most = (_in_ms(sample.quantile(share)) for share in (0.5, 0.95, 1))
    return document.Percentiles(p50=p50, p95=p95, max=most)


def _ms(nanoseconds: int | None) -> float | None:
    return None if nanoseconds is None else _in_ms(nanoseconds)


def _in_ms(nanoseconds: int) -> float:
    return round(nanoseconds / _NS_PER_MS, 3)
