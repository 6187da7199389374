"""`syncrelay --config FILE --explain N`: run for N seconds and say how every group fares."""

import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

from syncrelay.cli.boundary import AT_FAULT, DONE, put
from syncrelay.cli.stop import StopRequest

if TYPE_CHECKING:
    from syncrelay.explain import GroupReport
    from syncrelay.ros.relay import Relay


def explain(relay: "Relay", seconds: float, *, stop: StopRequest) -> int:
    """Print the findings of all groups once the time is over or a signal came; 0 if every group is healthy."""
    end = time.monotonic() + seconds
    while not stop.requested and (left := end - time.monotonic()) > 0:
        relay.step(left)
    reports = relay.look()
    for report in reports:
        for line in _lines(report):
            put(line)
    return DONE if all(_is_healthy(report) for report in reports) else AT_FAULT


def _is_healthy(report: "GroupReport") -> bool:
    from syncrelay.explain import Severity

    gave_sets = report.facts.figures.last_set is not None
    return gave_sets and all(finding.severity is Severity.OK for finding in report.findings)


def _lines(report: "GroupReport") -> Iterator[str]:
    from syncrelay.explain import Severity

    words = {Severity.OK: "ok", Severity.WARN: "warning", Severity.ERROR: "error"}
    for finding in sorted(report.findings, key=lambda each: -each.severity):
        yield f"{report.facts.name}: {words[finding.severity]}: {finding.text} [{finding.code.value}]"
        if finding.suggestion:
            yield f"    {finding.suggestion}"
