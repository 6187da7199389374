"""What the relay publishes about itself: /diagnostics, and figures for plotting."""

import logging
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Final

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from std_msgs.msg import Float64

from syncrelay.config import Config
from syncrelay.config.names_in_graph import DIAGNOSTICS, SCALARS
from syncrelay.config.profile import Profile
from syncrelay.dataflow.bugs import OnceLog
from syncrelay.explain import Distribution, DropFates, GroupReport, InputFacts, explanation
from syncrelay.relay.entities import Entities, RefusedError
from syncrelay.relay.ports import Node, Publisher, Purpose
from syncrelay.status import Level, level

_LEVELS: Final = {
    Level.OK: DiagnosticStatus.OK,
    Level.WARN: DiagnosticStatus.WARN,
    Level.ERROR: DiagnosticStatus.ERROR,
    Level.STALE: DiagnosticStatus.STALE,
}
_NS_PER_MS: Final = 1e6
_NS_PER_SECOND: Final = 1_000_000_000


class Reporters:
    """Publishes what the file asks for. A publisher that DDS refuses is tried again at each report."""

    def __init__(self, node: Node, entities: Entities, *, now: Callable[[], int]) -> None:
        """Take the clock that stamps what is published, in nanoseconds."""
        self._node = node
        self._now = now
        self._entities = entities
        self._wanted: dict[str, Callable[[], Diagnostics | Scalars]] = {}
        self._reporters: dict[str, Diagnostics | Scalars] = {}
        self._once = OnceLog()

    def configure(self, config: Config, groups: Sequence[str]) -> None:
        """Publish what this file asks for of these groups from now on; what was published before goes on."""
        asked = config.diagnostics if self._entities.purpose is Purpose.RELAY else None
        self._wanted = {}
        if asked is not None:
            self._wanted[DIAGNOSTICS] = lambda: Diagnostics(self._node, self._entities, now=self._now)
            if asked.scalars:
                self._wanted |= {group: partial(Scalars, self._entities, group) for group in groups}
        for key in [key for key in self._reporters if key not in self._wanted]:
            self._reporters.pop(key).close()
        self._make()

    def publish(self, reports: Sequence[GroupReport], *, advice: str | None = None) -> None:
        """Publish the state of all groups, and why a managed node gives nothing."""
        self._make()
        for each in self._reporters.values():
            each.publish(reports, advice=advice)

    def _make(self) -> None:
        for key, make in self._wanted.items():
            if key not in self._reporters:
                try:
                    self._reporters[key] = make()
                except RefusedError as error:
                    self._once.log(logging.WARNING, str(error))


class Diagnostics:
    """Publishes one DiagnosticStatus a group, `<node>: <group>`; the suggestion is among its values."""

    def __init__(self, node: Node, entities: Entities, *, now: Callable[[], int]) -> None:
        """Raise RefusedError where DDS does not make the publisher."""
        self._node = node
        self._entities = entities
        self._now = now
        self._name = node.name
        self._publisher = entities.publisher(DiagnosticArray, DIAGNOSTICS, Profile())

    def publish(self, reports: Sequence[GroupReport], *, advice: str | None) -> None:
        """Publish the state of all groups, and of a managed node that gives nothing, if anyone listens."""
        if self._publisher.is_heard():
            array = DiagnosticArray(status=[self._status(report) for report in reports])
            if advice is not None:
                warn, name = DiagnosticStatus.WARN, self._name
                array.status.append(
                    DiagnosticStatus(level=warn, name=name.lstrip("/"), message=advice, hardware_id=name)
                )
            array.header.stamp.sec, array.header.stamp.nanosec = divmod(self._now(), _NS_PER_SECOND)
            self._publisher.publish(array)

    def close(self) -> None:
        """Publish no more."""
        self._entities.end(self._publisher)

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
        self._group = group
        self._publishers: dict[str, Publisher] = {}
        try:
            for figure in SCALARS:
                self._publishers[figure] = entities.publisher(Float64, f"~/{group}/{figure}", Profile())
        except RefusedError:
            self.close()
            raise

    def publish(self, reports: Sequence[GroupReport], *, advice: str | None) -> None:  # noqa: ARG002  as Diagnostics
        """Publish the rate, and span and latency if sets left."""
        figures = next((each.facts.figures for each in reports if each.facts.name == self._group), None)
        if figures is None:
            return
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
