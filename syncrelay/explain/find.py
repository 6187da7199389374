"""All findings of a group, in the order in which they explain a silence."""

from collections.abc import Iterable
from typing import Final

from syncrelay.explain import rules_flow, rules_graph, rules_matching, rules_stamps, words
from syncrelay.explain.facts import GroupFacts
from syncrelay.explain.findings import Code, Finding, Rule, Severity, of_each_input

_RULES: Final[tuple[Rule, ...]] = (
    rules_graph.internal_error,
    of_each_input(rules_graph.refused_by_dds),
    of_each_input(rules_graph.type_not_importable),
    of_each_input(rules_graph.other_type),
    of_each_input(rules_graph.no_publisher),
    of_each_input(rules_graph.incompatible_qos),
    rules_graph.clock_stopped,
    of_each_input(rules_graph.silent),
    of_each_input(rules_stamps.malformed),
    of_each_input(rules_stamps.unstamped),
    rules_stamps.other_clock,
    rules_stamps.no_common_key,
    of_each_input(rules_flow.bursts),
    rules_matching.over_slop,
    of_each_input(rules_matching.short_queue),
    of_each_input(rules_matching.waiting_for_optional),
    of_each_input(rules_stamps.time_jump),
    of_each_input(rules_flow.messages_lost),
    rules_flow.too_slow,
    of_each_input(rules_flow.slowed),
    of_each_input(rules_stamps.out_of_order),
    of_each_input(rules_stamps.duplicates),
    rules_stamps.clock_drift,
    rules_matching.constant_offset,
    of_each_input(rules_graph.subscriber_qos),
    of_each_input(rules_graph.output_taken),
)


def find(facts: GroupFacts) -> tuple[Finding, ...]:
    """Return all findings, one at least; see `explanation` for the one that matters most."""
    return with_ok(facts, problems(facts))


def problems(facts: GroupFacts) -> tuple[Finding, ...]:
    """Return what is not as ever, an error at least of a silent group; nothing to mend where a group is well."""
    found = [finding for rule in _RULES for finding in rule(facts)]
    if facts.is_silent and not any(finding.severity is Severity.ERROR for finding in found):
        found.append(_unexplained(facts))
    elif _is_well(found) and facts.figures.last_set is not None:
        # Few sets are what other findings come to: it is said where none of them is there.
        found += rules_matching.few_sets(facts)
    return tuple(found)


def with_ok(facts: GroupFacts, found: tuple[Finding, ...]) -> tuple[Finding, ...]:
    """Add to what is remarkable that a group is well, or starts; in figures that cost more than all rules."""
    if not _is_well(found):
        return found
    if facts.figures.last_set is None:
        since = words.seconds(facts.figures.now - facts.figures.began)
        return (*found, Finding(Code.STARTING, Severity.OK, f"no set yet, {since} after the start"))
    return (*found, _healthy(facts))


def _is_well(found: Iterable[Finding]) -> bool:
    return all(finding.severity is Severity.OK for finding in found)


def explanation(findings: tuple[Finding, ...]) -> Finding:
    """Return the finding that says most of a group's state: the first of the worst, the last if nothing is bad."""
    worst = max(finding.severity for finding in findings)
    if worst is Severity.OK:
        return findings[-1]
    return next(finding for finding in findings if finding.severity is worst)


def _unexplained(facts: GroupFacts) -> Finding:
    fates = "; ".join(rules_flow.fates(each) for each in facts.inputs)
    return Finding(
        Code.UNEXPLAINED,
        Severity.ERROR,
        f"messages come on all inputs, but no set leaves: {fates}",
        rules_matching.more_sets(facts, Code.UNEXPLAINED)
        or "run `syncrelay doctor --config FILE --live`, which checks the graph and the stamps",
    )


def _healthy(facts: GroupFacts) -> Finding:
    figures = facts.figures
    sets = f"{words.figure(figures.rate_hz)} of {words.figure(max(facts.possible_hz, figures.rate_hz))}"
    span, latency = (words.duration(each.quantile(0.95)) for each in (figures.spans, figures.latencies))
    text = f"{sets} possible sets a second, span {span} and latency {latency} at the 95th percentile"
    return Finding(Code.HEALTHY, Severity.OK, text)
