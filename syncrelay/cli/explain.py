"""`syncrelay --config FILE --explain N`: look for N seconds, publish nothing, and say how every group fares."""

import time
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from syncrelay.cli.boundary import AT_FAULT, DONE, put
from syncrelay.cli.stop import StopRequest

if TYPE_CHECKING:
    from syncrelay.explain import GroupReport
    from syncrelay.ros.relay import Relay


def explain(relay: "Relay", seconds: float, *, stop: StopRequest) -> int:
    """Print the findings of all groups once the time is over or a signal came; 0 if every group is healthy."""
    began = time.monotonic()
    reports = relay.look(seconds, is_over=lambda: stop.requested)
    return conclude(reports, time.monotonic() - began, unjudged=relay.monitor.unjudged)


def conclude(reports: "Sequence[GroupReport]", looked_s: float, *, unjudged: "Sequence[str]" = ()) -> int:
    """Print the findings of groups; 0 if every one is healthy, else 1 with a last line that says what decided that.

    `unjudged` are groups of which there is no report.
    """
    for report in reports:
        for line in _lines(report):
            put(line)
    faults = [f"{report.facts.name} {fault}" for report in reports if (fault := _fault(report, looked_s))]
    faults += [f"{name} could not be evaluated: see the log" for name in unjudged]
    if not faults:
        return DONE
    put(f"exit code 1: {'; '.join(faults)}")
    return AT_FAULT


def _fault(report: "GroupReport", looked_s: float) -> str | None:
    """Say why a group is not healthy, None if it is."""
    from syncrelay.explain import Severity

    for severity, word in ((Severity.ERROR, "error"), (Severity.WARN, "warning")):
        if count := sum(finding.severity is severity for finding in report.findings):
            return f"has {count} {word}{'s' if count > 1 else ''}"
    if report.facts.figures.last_set is None:
        return f"produced no set in {looked_s:.0f} s, which is too short to tell why: give --explain a larger N"
    return None


def _lines(report: "GroupReport") -> Iterator[str]:
    from syncrelay.explain import Severity

    words = {Severity.OK: "ok", Severity.WARN: "warning", Severity.ERROR: "error"}
    for finding in sorted(report.findings, key=lambda each: -each.severity):
        yield f"{report.facts.name}: {words[finding.severity]}: {finding.text} [{finding.code.value}]"
        if finding.suggestion:
            yield f"    {finding.suggestion}"
