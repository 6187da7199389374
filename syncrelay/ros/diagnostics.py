"""What the relay publishes about itself: /diagnostics, and figures for plotting."""

from collections.abc import Iterator, Sequence
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from std_msgs.msg import Float64

from syncrelay.config.own_topics import DIAGNOSTICS, SCALARS
from syncrelay.explain import Distribution, GroupReport, InputFacts, explanation
from syncrelay.status import Level, level

_LEVELS: Final = {
    Level.OK: DiagnosticStatus.OK,
    Level.WARN: DiagnosticStatus.WARN,
    Level.ERROR: DiagnosticStatus.ERROR,
    Level.STALE: DiagnosticStatus.STALE,
}
_NS_PER_MS: Final = 1e6
_NS_PER_SECOND: Final = 1e9


class Diagnostics:
    """Publishes one DiagnosticStatus a group, `<node>: <group>`; the suggestion is among its values."""

    def __init__(self, node: Any) -> None:
        self._node = node
        self._name = node.get_fully_qualified_name()
        self._publisher = node.create_publisher(DiagnosticArray, DIAGNOSTICS, 10)

    def publish(self, reports: Sequence[GroupReport]) -> None:
        """Publish the state of all groups, if anyone listens."""
        if self._publisher.get_subscription_count():
            array = DiagnosticArray(status=[self._status(report) for report in reports])
            array.header.stamp = self._node.get_clock().now().to_msg()
            self._publisher.publish(array)

    def close(self) -> None:
        """Publish no more."""
        self._node.destroy_publisher(self._publisher)

    def _status(self, report: GroupReport) -> DiagnosticStatus:
        return DiagnosticStatus(
            level=_LEVELS[level(report)],
            name=f"{self._name.lstrip('/')}: {report.facts.name}",
            message=explanation(report.findings).text,
            hardware_id=self._name,
            values=[KeyValue(key=key, value=value) for key, value in _values(report)],
        )


class Scalars:
    """Publishes the figures of each group as Float64 on `~/GROUP/sets_hz`, `.../span_ms` and `.../latency_ms`."""

    def __init__(self, node: Any, groups: Sequence[str]) -> None:
        self._node = node
        self._publishers = {
            (group, figure): node.create_publisher(Float64, f"~/{group}/{figure}", 10)
            for group in groups
            for figure in SCALARS
        }

    def publish(self, reports: Sequence[GroupReport]) -> None:
        """Publish what there is; spans and latencies only where sets left."""
        for report in reports:
            figures = report.facts.figures
            self._publish(report, "sets_hz", figures.rate_hz)
            if figures.last_sets:
                span, latency = figures.last_sets[0]
                self._publish(report, "span_ms", span / _NS_PER_MS)
                self._publish(report, "latency_ms", latency / _NS_PER_MS)

    def close(self) -> None:
        """Publish no more."""
        for publisher in self._publishers.values():
            self._node.destroy_publisher(publisher)

    def _publish(self, report: GroupReport, figure: str, value: float) -> None:
        self._publishers[report.facts.name, figure].publish(Float64(data=value))


def _values(report: GroupReport) -> Iterator[tuple[str, str]]:
    facts, figures = report.facts, report.facts.figures
    finding = explanation(report.findings)
    yield "finding", finding.code.value
    if finding.suggestion:
        yield "suggestion", finding.suggestion
    yield "policy", facts.policy
    yield "sets", str(figures.sets)
    yield "sets (Hz)", f"{figures.rate_hz:.2f}"
    yield "possible sets (Hz)", f"{facts.possible_hz:.2f}"
    yield from _percentiles("span", figures.spans)
    yield from _percentiles("latency", figures.latencies)
    for each in facts.inputs:
        yield from _of_input(each, figures.now)


def _of_input(each: InputFacts, now: int) -> Iterator[tuple[str, str]]:
    figures = each.figures
    yield f"{each.name} rate (Hz)", f"{figures.rate_hz:.2f}"
    if figures.last_received is not None:
        yield f"{each.name} age (s)", f"{(now - figures.last_received) / _NS_PER_SECOND:.2f}"
    yield f"{each.name} received", str(each.counts.fed)
    yield f"{each.name} matched", str(each.counts.matched)
    for reason, count in sorted(each.counts.dropped.items(), key=lambda item: item[0].value):
        yield f"{each.name} dropped, {reason.value}", str(count)


def _percentiles(quantity: str, sample: Distribution) -> Iterator[tuple[str, str]]:
    if sample:
        yield f"{quantity} median (ms)", f"{sample.quantile(0.5) / _NS_PER_MS:.2f}"
        yield f"{quantity} p95 (ms)", f"{sample.quantile(0.95) / _NS_PER_MS:.2f}"
