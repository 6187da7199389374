"""What the relay publishes about itself: /diagnostics, and figures for plotting."""

import logging
from collections.abc import Iterator, Sequence
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from std_msgs.msg import Float64

from syncrelay.config import Config
from syncrelay.config.names_in_graph import DIAGNOSTICS, SCALARS
from syncrelay.dataflow.bugs import OnceLog
from syncrelay.explain import Distribution, DropFates, GroupReport, InputFacts, explanation
from syncrelay.ros.entities import Entities, Purpose, RefusedError
from syncrelay.status import Level, level

_LEVELS: Final = {
    Level.OK: DiagnosticStatus.OK,
    Level.WARN: DiagnosticStatus.WARN,
    Level.ERROR: DiagnosticStatus.ERROR,
    Level.STALE: DiagnosticStatus.STALE,
}
# In the place of a group's name, which is never empty.
_ALL: Final = ""
_NS_PER_MS: Final = 1e6
_NS_PER_SECOND: Final = 1e9


class Reporters:
    """Publishes what the file asks for. A publisher that DDS refuses is tried again at each report."""

    def __init__(self, node: Any, entities: Entities) -> None:
        self._node = node
        self._entities = entities
        self._wanted: tuple[str, ...] = ()
        self._reporters: dict[str, Diagnostics | Scalars] = {}
        self._once = OnceLog()

    def configure(self, config: Config, groups: Sequence[str]) -> None:
        """Publish what this file asks for of these groups from now on; what was published before goes on."""
        asked = config.diagnostics if self._entities.purpose is Purpose.RELAY else None
        self._wanted = () if asked is None else (_ALL, *groups) if asked.scalars else (_ALL,)
        for key in [key for key in self._reporters if key not in self._wanted]:
            self._reporters.pop(key).close()
        self._make()

    def publish(self, reports: Sequence[GroupReport], *, advice: str | None = None) -> None:
        """Publish the state of all groups, and why a managed node gives nothing."""
        self._make()
        if isinstance(diagnostics := self._reporters.get(_ALL), Diagnostics):
            diagnostics.publish(reports, advice=advice)
        for report in reports:
            if isinstance(scalars := self._reporters.get(report.facts.name), Scalars):
                scalars.publish(report)

    def _make(self) -> None:
        for key in self._wanted:
            if key not in self._reporters:
                try:
                    self._reporters[key] = (
                        Diagnostics(self._node, self._entities) if key == _ALL else Scalars(self._entities, key)
                    )
                except RefusedError as error:
                    self._once.log(logging.WARNING, str(error))


class Diagnostics:
    """Publishes one DiagnosticStatus a group, `<node>: <group>`; the suggestion is among its values."""

    def __init__(self, node: Any, entities: Entities) -> None:
        """Raise RefusedError where DDS does not make the publisher."""
        self._node = node
        self._entities = entities
        self._name = node.get_fully_qualified_name()
        self._publisher = entities.publisher(DiagnosticArray, DIAGNOSTICS, 10)

    def publish(self, reports: Sequence[GroupReport], *, advice: str | None) -> None:
        """Publish the state of all groups, and of a managed node that gives nothing, if anyone listens."""
        if self._publisher.get_subscription_count():
            array = DiagnosticArray(status=[self._status(report) for report in reports])
            if advice is not None:
                array.status.append(self._of_node(advice))
            array.header.stamp = self._node.get_clock().now().to_msg()
            self._publisher.publish(array)

    def close(self) -> None:
        """Publish no more."""
        self._entities.end(self._publisher)

    def _of_node(self, advice: str) -> DiagnosticStatus:
        name = self._name.lstrip("/")
        return DiagnosticStatus(level=DiagnosticStatus.WARN, name=name, message=advice, hardware_id=self._name)

    def _status(self, report: GroupReport) -> DiagnosticStatus:
        return DiagnosticStatus(
            level=_LEVELS[level(report)],
            name=f"{self._name.lstrip('/')}: {report.facts.name}",
            message=explanation(report.findings).text,
            hardware_id=self._name,
            values=[KeyValue(key=key, value=value) for key, value in _values(report)],
        )


class Scalars:
    """Publishes the figures of a group as Float64 on `~/GROUP/sets_hz`, `.../span_ms` and `.../latency_ms`."""

    def __init__(self, entities: Entities, group: str) -> None:
        """Raise RefusedError where DDS does not make one of the publishers."""
        self._entities = entities
        self._publishers: dict[str, Any] = {}
        try:
            for figure in SCALARS:
                self._publishers[figure] = entities.publisher(Float64, f"~/{group}/{figure}", 10)
        except RefusedError:
            self.close()
            raise

    def publish(self, report: GroupReport) -> None:
        """Publish the rate, and span and latency if sets left."""
        figures = report.facts.figures
        values = {"sets_hz": figures.rate_hz}
        if figures.last_sets:
            span, latency = figures.last_sets[0]
            values |= {"span_ms": span / _NS_PER_MS, "latency_ms": latency / _NS_PER_MS}
        for figure, value in values.items():
            self._publishers[figure].publish(Float64(data=value))

    def close(self) -> None:
        """Publish no more."""
        for publisher in self._publishers.values():
            self._entities.end(publisher)


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
    for each, fates in zip(facts.inputs, facts.fates, strict=True):
        yield from _of_input(each, fates, figures.now)


def _of_input(each: InputFacts, fates: DropFates, now: int) -> Iterator[tuple[str, str]]:
    figures = each.figures
    yield f"{each.name} rate (Hz)", f"{figures.rate_hz:.2f}"
    if figures.last_received is not None:
        yield f"{each.name} age (s)", f"{(now - figures.last_received) / _NS_PER_SECOND:.2f}"
    yield f"{each.name} received", str(each.counts.fed)
    yield f"{each.name} matched", str(each.counts.matched)
    if fates.unneeded:
        yield f"{each.name} not needed", str(fates.unneeded)
    for reason, count in sorted(fates.others.items(), key=lambda item: item[0].value):
        yield f"{each.name} dropped, {reason.value}", str(count)


def _percentiles(quantity: str, sample: Distribution) -> Iterator[tuple[str, str]]:
    if sample:
        yield f"{quantity} median (ms)", f"{sample.quantile(0.5) / _NS_PER_MS:.2f}"
        yield f"{quantity} p95 (ms)", f"{sample.quantile(0.95) / _NS_PER_MS:.2f}"
