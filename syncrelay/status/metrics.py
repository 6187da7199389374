"""The state of a relay as Prometheus metrics."""

import platform
from collections.abc import Callable, Iterator
from itertools import accumulate

from prometheus_client import CollectorRegistry
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily, InfoMetricFamily
from prometheus_client.metrics_core import Metric
from prometheus_client.registry import Collector

from syncrelay import own_version
from syncrelay.explain import BOUNDS_NS, Finding, GroupReport, Histogram
from syncrelay.status.state import RelayState, is_ready

_NS_PER_SECOND = 1e9


def registry(state: Callable[[], RelayState]) -> CollectorRegistry:
    """Return a registry that asks for the state at every scrape."""
    metrics = CollectorRegistry()
    metrics.register(_OfState(state))
    return metrics


class _OfState(Collector):
    def __init__(self, state: Callable[[], RelayState]) -> None:
        self._state = state

    def describe(self) -> list[Metric]:
        """Keep the registry from collecting when this is registered."""
        return []

    def collect(self) -> Iterator[Metric]:
        state = self._state()
        yield _build(state)
        yield GaugeMetricFamily(
            "syncrelay_ready",
            "1 if the relay runs, is not paused, and every required input has a publisher that fits.",
            value=is_ready(state),
        )
        yield CounterMetricFamily("syncrelay_reloads", "Reloads that succeeded.", value=state.reloads)
        yield from _of_inputs(state)
        yield from _of_groups(state)
        yield _findings(state)


def _build(state: RelayState) -> Metric:
    info = InfoMetricFamily("syncrelay_build", "Version of what is running.")
    values = {"version": own_version(), "python": platform.python_version(), "receives_by": state.receives_by}
    info.add_metric([], values)
    return info


def _of_inputs(state: RelayState) -> Iterator[Metric]:
    received = CounterMetricFamily("syncrelay_messages_received", "Messages received.", labels=("group", "topic"))
    outcomes = CounterMetricFamily(
        "syncrelay_messages",
        "Messages by what became of them: matched, or the reason why they were dropped.",
        labels=("group", "topic", "outcome"),
    )
    lost = CounterMetricFamily(
        "syncrelay_messages_lost",
        "Messages that DDS lost on their way to the relay, which are none of those received. What a publisher sent"
        " before it was found is not counted.",
        labels=("group", "topic"),
    )
    by_sender = ("group", "topic", "publisher")
    sent = CounterMetricFamily(
        "syncrelay_messages_sent",
        "Messages that a node published, by the numbers that they have, from the first that came on. Those beyond"
        " syncrelay_messages_delivered were lost. No sample where messages do not say whose they are.",
        labels=by_sender,
    )
    delivered = CounterMetricFamily("syncrelay_messages_delivered", "Those of them that came.", labels=by_sender)
    buffered = GaugeMetricFamily("syncrelay_queue_length", "Messages waiting in queues.", labels=("group", "topic"))
    for report in state.groups:
        for each in report.facts.inputs:
            labels = [report.facts.name, each.name]
            received.add_metric(labels, each.counts.fed)
            lost.add_metric(labels, each.graph.lost_in_all)
            for sender in each.graph.senders:
                sent.add_metric([*labels, sender.node], sender.sent_in_all)
                delivered.add_metric([*labels, sender.node], sender.delivered_in_all)
            buffered.add_metric(labels, each.counts.buffered)
            outcomes.add_metric([*labels, "matched"], each.counts.matched)
            for reason, count in each.counts.dropped.items():
                outcomes.add_metric([*labels, reason.value], count)
    yield from (received, lost, sent, delivered, outcomes, buffered)


def _of_groups(state: RelayState) -> Iterator[Metric]:
    sets = CounterMetricFamily("syncrelay_sets", "Sets published.", labels=("group",))
    last = GaugeMetricFamily(
        "syncrelay_last_set_timestamp_seconds",
        "When the last set was published, in seconds since 1970, to about a second. No sample before the first set, nor"
        " before the next one after a lazy group slept.",
        labels=("group",),
    )
    spans = HistogramMetricFamily(
        "syncrelay_set_span_seconds",
        "Spans of the sets: the latest stamp of a set minus the earliest.",
        labels=("group",),
    )
    latencies = HistogramMetricFamily(
        "syncrelay_set_latency_seconds",
        "From the receipt of a set's newest message until the set was published.",
        labels=("group",),
    )
    for report in state.groups:
        figures = report.facts.figures
        sets.add_metric([report.facts.name], figures.sets)
        if figures.last_set is not None:
            last.add_metric([report.facts.name], figures.last_set / _NS_PER_SECOND)
        _add(spans, report.facts.name, figures.span_histogram)
        _add(latencies, report.facts.name, figures.latency_histogram)
    yield from (sets, last, spans, latencies)


def _add(family: HistogramMetricFamily, group: str, histogram: Histogram) -> None:
    bounds = [f"{bound / _NS_PER_SECOND:g}" for bound in BOUNDS_NS]
    buckets = list(zip([*bounds, "+Inf"], accumulate(histogram.counts), strict=True))
    family.add_metric([group], buckets=buckets, sum_value=histogram.sum / _NS_PER_SECOND)


def _findings(state: RelayState) -> Metric:
    family = GaugeMetricFamily(
        "syncrelay_finding", "1 for each finding that holds.", labels=("group", "code", "severity", "topic")
    )
    # Findings that differ only in their sentence are one series.
    for labels in dict.fromkeys(_labels(report, finding) for report in state.groups for finding in report.findings):
        family.add_metric(labels, 1)
    return family


def _labels(report: GroupReport, finding: Finding) -> tuple[str, str, str, str]:
    topic = "" if finding.input is None else report.facts.inputs[finding.input].name
    return report.facts.name, finding.code.value, finding.severity.name.lower(), topic
