"""A look at groups for a time, which goes on while more will be known soon."""

from collections.abc import Callable
from typing import Final

from syncrelay.explain import GroupReport, Severity
from syncrelay.relay.monitor import EVALUATE_S
from syncrelay.relay.relay import Relay

# It goes on at most this much longer.
_LONGER_S: Final = 10.0
# So many sets in a row that should have come and did not are no chance, but do not tell why either.
_DUE: Final = 3


def look(relay: Relay, seconds: float, *, is_over: Callable[[], bool] = lambda: False) -> tuple[GroupReport, ...]:
    """Run a relay for a time, and return a report of each group.

    It takes a little longer where a group without a set has just got its first messages, where its publishers may
    not have been found yet, or where sets have just stopped.
    """
    end = relay.runtime.monotonic() + seconds
    latest = end + _LONGER_S
    while not is_over() and (left := end - relay.runtime.monotonic()) > 0:
        relay.step(left)
        if relay.runtime.monotonic() >= end and any(map(is_early, relay.evaluate())):
            end = min(end + EVALUATE_S, latest)
    return relay.evaluate()


def is_early(report: GroupReport) -> bool:
    """Whether more will be known soon about why a group gives no set, or has just stopped doing so."""
    facts = report.facts
    is_incomplete = facts.is_discovering and not all(each.graph.publishers for each in facts.inputs)
    due = facts.silent_for / 1e9 * facts.possible_hz
    is_well = all(each.severity is Severity.OK for each in report.problems)
    has_just_stopped = is_well and (facts.figures.share.is_pausing or due >= _DUE)
    return facts.is_new or is_incomplete or has_just_stopped
