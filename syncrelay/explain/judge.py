"""All that is wrong with a group: causes, in the order in which they explain a silence, and what no cause explains.

Rules say what they see. Many see the effects of one cause: a relay that stood still loses messages, and then queues
seem too short, spans too wide and inputs silent. EXPLAINS is the table of who explains whom. What is explained is not
said and suggests nothing, while its cause holds and until the messages of that time are no longer judged by.

- An explained finding explains others all the same: a relay that stood still explains an input that seems slow, and so
  the wide spans that such an input explains.
- A finding about an optional input explains others about this input only, unless its stamps jump back and forth.
- A finding whose `explains` is False is too small to explain others.
- A cause that is over explains no more once few of the sets left that were possible since. What else is found is said
  first.
- If all errors of a silent group are explained, their cause is the error.
"""

from collections.abc import Iterable
from dataclasses import replace
from typing import Final

from syncrelay.config.wording import counted
from syncrelay.explain import (
    rules_clock,
    rules_drift,
    rules_flow,
    rules_graph,
    rules_matching,
    rules_offset,
    rules_outputs,
    rules_stamps,
    rules_transforms,
    words,
)
from syncrelay.explain.causes import (
    EXPLAINS,
    OF_CLOCKS,
    SEEN_SINCE,
    SETTLES,
    Cause,
    effects_until,
    ended,
    explained_by,
    is_aside,
    may_cost,
    most_missed,
    outlasts,
    over_since,
    seen_since,
    set_at,
)
from syncrelay.explain.codes import MATCHING, Code, Of, Severity
from syncrelay.explain.facts import GroupFacts, InputFacts
from syncrelay.explain.findings import Finding, Rule, found_by, of_each_input
from syncrelay.explain.known_soon import known_soon
from syncrelay.explain.order import WINDOW_NS
from syncrelay.explain.standing import BACK, FEW, Standing

_CAUSE_RULES: Final[tuple[Rule, ...]] = (
    Rule(Code.INTERNAL_ERROR, rules_graph.internal_error),
    Rule(Code.INACTIVE, rules_graph.inactive),
    Rule(Code.PAUSED, rules_flow.paused),
    of_each_input(Code.REFUSED_BY_DDS, rules_graph.refused_by_dds, InputFacts.is_served),
    Rule(Code.NO_BUNDLE, rules_graph.no_bundle),
    of_each_input(Code.TYPE_NOT_IMPORTABLE, rules_graph.type_not_importable, InputFacts.is_served),
    of_each_input(Code.OTHER_TYPE, rules_graph.other_type, InputFacts.is_served),
    of_each_input(Code.SEVERAL_TYPES, rules_graph.several_types, InputFacts.is_served),
    Rule(Code.ALONE, rules_graph.alone),
    Rule(Code.NO_PUBLISHER, rules_graph.no_publisher, InputFacts.is_served),
    of_each_input(Code.INCOMPATIBLE_QOS, rules_graph.incompatible_qos, InputFacts.is_served),
    Rule(Code.NOBODY_LISTENS, rules_outputs.nobody_listens),
    Rule(Code.NO_CLOCK, rules_graph.no_clock),
    Rule(Code.CLOCK_STOPPED, rules_graph.clock_stopped),
    Rule(Code.TOO_SLOW, rules_flow.too_slow),
    Rule(Code.SILENT, rules_graph.silent),
    of_each_input(Code.MALFORMED, rules_stamps.malformed, InputFacts.comes_in_order),
    of_each_input(Code.UNSTAMPED, rules_stamps.unstamped, InputFacts.comes_in_order),
    of_each_input(Code.SEVERAL_PUBLISHERS, rules_stamps.several_publishers, InputFacts.comes_in_order),
    Rule(Code.CLOCK_STEP, rules_stamps.clock_step),
    Rule(Code.CLOCK_DRIFT, rules_drift.clock_drift),
    Rule(Code.OTHER_CLOCK, rules_stamps.other_clock),
    Rule(Code.OTHER_CLOCK, rules_clock.off_the_clock),
    of_each_input(Code.SLOWED, rules_flow.slowed, InputFacts.comes_in_order),
    Rule(Code.BURSTS, rules_flow.bursts, InputFacts.comes_in_order),
    of_each_input(Code.TIME_JUMP, rules_stamps.time_jump, InputFacts.comes_in_order),
    of_each_input(Code.MESSAGES_LOST, rules_flow.messages_lost, InputFacts.comes_in_order),
    of_each_input(Code.OUT_OF_ORDER, rules_stamps.out_of_order, InputFacts.comes_in_order),
    of_each_input(Code.DUPLICATES, rules_stamps.duplicates, InputFacts.comes_in_order),
)

_MATCHING_RULES: Final[tuple[Rule, ...]] = (
    Rule(Code.NO_COMMON_KEY, rules_stamps.no_common_key),
    Rule(Code.OVER_SLOP, rules_matching.over_slop),
    Rule(Code.OVER_SLOP, rules_clock.too_old),
    of_each_input(Code.SHORT_QUEUE, rules_matching.short_queue),
    of_each_input(Code.WAITING_FOR_OPTIONAL, rules_matching.waiting_for_optional),
    Rule(Code.NO_TRANSFORM, rules_transforms.no_transform),
    Rule(Code.CONSTANT_OFFSET, rules_offset.constant_offset),
)
"""What they suggest they try, which costs: they are not asked for what a cause explains."""

_OTHER_RULES: Final[tuple[Rule, ...]] = (
    of_each_input(Code.SUBSCRIBER_QOS, rules_outputs.subscriber_qos, InputFacts.is_ours_alone),
    Rule(Code.SUBSCRIBER_QOS, rules_outputs.bundle_subscriber_qos),
    of_each_input(Code.OUTPUT_TAKEN, rules_outputs.output_taken, InputFacts.is_ours_alone),
    Rule(Code.OUTPUT_TAKEN, rules_outputs.bundle_taken),
)
_FEW_SETS: Final = Rule(Code.FEW_SETS, rules_matching.few_sets)


class Judge:
    """Judges one group, poll by poll. Remembers causes that are over, as long as their effects may still be seen."""

    def __init__(self) -> None:
        self._causes: dict[tuple[Code, int | None], Cause] = {}
        self._too_wide: Finding | None = None
        self._missing_since: int | None = None

    def judge(self, facts: GroupFacts) -> tuple[Finding, ...]:
        """Return what is not as usual, an error at least of a silent group; see `with_ok` for what is well."""
        # Of two publishers whose names are not known yet, the same may be said.
        found = [*dict.fromkeys(found_by(_CAUSE_RULES, facts))]
        self._remember(found, facts)
        facts = self._since_the_last_cause(facts)
        self._missing_since = self._few_left_since(facts)
        for rule in () if facts.is_new else _MATCHING_RULES:
            if self._is_explained(rule.code, facts):
                continue
            found += rule.findings(facts)
        found += self._still_too_wide(found, facts)
        found += found_by(_OTHER_RULES, facts)
        if facts.is_silent and not any(finding.severity is Severity.ERROR for finding in found):
            found += [_unexplained(facts)] if facts.had_time and not rules_matching.is_too_soon(facts) else []
        said = self._unexplained_by_others(found, facts)
        # What is mended of the file or of stamps has cost sets that are missing from the share for a while.
        self._keep((each for each in said if each.code in MATCHING), facts)
        for each in said:
            cause = self._causes.get((each.code, each.input))
            if cause is not None and cause.at == facts.figures.now:
                self._causes[each.code, each.input] = cause._replace(was_said=True)
        said = self._as_bad_as_it_stands(said, facts) if rules_matching.has_few_sets(facts) else said
        return tuple(
            replace(each, suggestion=wait) if (wait := known_soon(facts, each.code)) else each for each in said
        )

    def _still_too_wide(self, found: Iterable[Finding], facts: GroupFacts) -> tuple[Finding, ...]:
        """Return that sets are often too wide, as it was last found, until the share of sets that leave is back.

        Else chance would end it and find it again, and so would a drift that may be the reason now and then.
        """
        if facts.is_silent:
            self._too_wide = None
            return ()
        share = facts.figures.share.value
        is_back = share is None or share >= BACK
        wide = next((each for each in found if each.code is Code.OVER_SLOP), None)
        # What is the effect of another cause is over when its cause is.
        own = wide if wide is not None and self._root(wide, facts) is wide else None
        self._too_wide, before = own or (None if is_back else self._too_wide), self._too_wide
        if before is None and self._too_wide is None:
            # As nearly always: the newest need not be looked at.
            return ()
        if rules_matching.is_near_again(facts):
            self._too_wide = None
            return ()
        if wide is not None or is_back or before is None or self._is_explained(Code.OVER_SLOP, facts):
            return ()
        return (before,)

    def explained(self, facts: GroupFacts) -> frozenset[Code]:
        """Return the codes of findings that causes may explain now: that they are not found does not end them."""
        return frozenset(
            code
            for cause in self._causes.values()
            for code in explained_by(cause.finding.code)
            if cause.at >= seen_since(code, facts)
        )

    def _remember(self, found: Iterable[Finding], facts: GroupFacts) -> None:
        now = facts.figures.now
        if self._causes:
            longest_ago = min([now - WINDOW_NS, *(since(facts) for since in SEEN_SINCE.values())])
            self._causes = {key: cause for key, cause in self._causes.items() if longest_ago <= cause.at <= now}
            # Whether a clock runs wrong is not known while it may have been set, and goes on until then.
            self._causes = {
                key: cause._replace(ended=now) if any(facts.inputs[at].figures.may_step for at in about) else cause
                for key, cause in self._causes.items()
                for about in [cause.finding.about if cause.finding.code in OF_CLOCKS else ()]
            }
        self._keep(found, facts)

    def _keep(self, found: Iterable[Finding], facts: GroupFacts) -> None:
        """Note that these causes hold now."""
        for finding in found:
            if finding.explains and finding.code in EXPLAINS:
                self._causes[finding.code, finding.input] = Cause(
                    finding,
                    facts.figures.now,
                    ended(finding, facts),
                    most_missed(finding, facts),
                    set_at(finding, facts),
                    is_aside=is_aside(finding, facts),
                )

    def _since_the_last_cause(self, facts: GroupFacts) -> GroupFacts:
        """Return the facts without how far stamps were apart while a cause held that is over: it has explained that."""
        over = (cause.ended for cause in self._causes.values() if Code.OVER_SLOP in explained_by(cause.finding.code))
        ended = max((at for at in over if at < facts.figures.now), default=None)
        return facts if ended is None else replace(facts, figures=facts.figures.measured_since(ended))

    def _is_explained(self, code: Code, facts: GroupFacts) -> bool:
        """Whether a cause that holds now explains all findings of a code."""
        return any(
            effects_until(cause, code) >= facts.figures.now
            and may_cost(cause, code, facts)
            and code in EXPLAINS[cause.finding.code].in_group
            and (cause.finding.input is None or facts.inputs[cause.finding.input].required)
            for cause in self._causes.values()
        )

    def _unexplained_by_others(self, found: Iterable[Finding], facts: GroupFacts) -> tuple[Finding, ...]:
        """Return the findings that nothing explains; of a silent group an error, be it a cause that is over."""
        roots = [(finding, self._root(finding, facts)) for finding in found]
        said = sorted((finding for finding, root in roots if finding is root), key=self._is_past)
        blamed = [root for finding, root in roots if finding.severity is Severity.ERROR]
        if blamed and not any(finding.severity is Severity.ERROR for finding in said):
            culprit = blamed[0]
            # It may be found now too, too small to explain anything.
            others = (each for each in said if (each.code, each.input) != (culprit.code, culprit.input))
            said = [replace(culprit, severity=Severity.ERROR), *others]
        return tuple(said)

    def _as_bad_as_it_stands(self, said: tuple[Finding, ...], facts: GroupFacts) -> tuple[Finding, ...]:
        """Return findings of which one is as bad as the share of sets that left: its cause, or that there are few."""
        least = Severity.ERROR if facts.standing is Standing.NONE else Severity.WARN
        # What is too small to be the cause, or is none of this, leaves open why sets are missing.
        spent = [each.finding for each in self._causes.values() if self._is_spent(each, facts)]
        told = [
            each
            for each in said
            if each.severity is not Severity.OK and _is_why(each) and not any(each is of for of in spent)
        ]
        if any(each.severity >= least for each in told):
            return said
        if told:
            return tuple(replace(each, severity=least) if each is told[0] else each for each in said)
        if self._missing_since is not None:
            # What causes have cost is not what is missing since.
            since = facts.figures.shares(self._missing_since)
            facts = replace(facts, figures=replace(facts.figures, share=since))
        (few,) = _FEW_SETS.findings(facts)
        over = [each for each in self._causes.values() if each.was_said and self._explains(each, few, facts)]
        if over:
            cause = max(over, key=lambda each: each.ended)
            until = f"until {words.seconds(facts.figures.now - cause.ended)} ago, {cause.finding.text}"
            text = f"{rules_matching.left_of_possible(facts)}; {until}"
            few = replace(cause.finding, severity=least, text=text, suggestion=None, is_over=True)
        return (few, *said)

    def _is_past(self, finding: Finding) -> bool:
        """Whether a finding is of what is over."""
        cause = self._causes.get((finding.code, finding.input))
        return cause is not None and cause.finding is finding and cause.ended < cause.at

    def _root(self, finding: Finding, facts: GroupFacts) -> Finding:
        """Return the cause that explains a finding and that nothing explains, or the finding itself."""
        # A relay that gets too little CPU makes all a little worse: what else is found says more.
        for cause in sorted(self._causes.values(), key=lambda each: each.finding.code is Code.TOO_SLOW):
            if self._explains(cause, finding, facts):
                return self._root(cause.finding, facts)
        return finding

    def _explains(self, cause: Cause, finding: Finding, facts: GroupFacts) -> bool:
        if not may_cost(cause, finding.code, facts) or (finding.code in MATCHING and self._is_spent(cause, facts)):
            return False
        looks_back = finding.code is Code.FEW_SETS
        if looks_back and facts.figures.share.possible - facts.figures.share.left > cause.most:
            return False
        is_over = cause.at < facts.figures.now and not looks_back
        if cause.finding.code.of is Of.GRAPH and is_over and finding.severity is Severity.ERROR:
            # What the graph shows no more is not why no set leaves now.
            return False
        explained, about = EXPLAINS[cause.finding.code], cause.finding.input
        if outlasts(finding, cause, facts) or finding.code not in explained.in_group | explained.of_input:
            return False
        is_narrow = finding.code not in explained.in_group or cause.is_aside or _is_of_own_stamps(finding, facts)
        if is_narrow and about is not None and about != finding.input:
            return False
        since = seen_since(finding.code, facts)
        if finding.severity is Severity.ERROR and not looks_back:
            # A silence is told by what comes now, or does not: a cause that is long over is no reason for it.
            since = max(since, facts.figures.now - facts.silent_after)
        elif rules_matching.has_few_sets(facts):
            # Nor is it one for recently missing sets, however far back the stamps are compared.
            since = max(since, seen_since(Code.FEW_SETS, facts))
        # Nor is one that ended when fewer sets, or none, should have left since, however long it is remembered.
        return effects_until(cause, finding.code) >= since

    def _is_spent(self, cause: Cause, facts: GroupFacts) -> bool:
        """Whether a cause is over, and few of the sets that were possible since have left: for another reason."""
        return self._missing_since is not None and effects_until(cause, Code.FEW_SETS) < facts.figures.now

    def _few_left_since(self, facts: GroupFacts) -> int | None:
        """Return since when no cause is known of those that keep sets from leaving, if few have left since then."""
        ends = [
            over_since(each, facts)
            for each in self._causes.values()
            if Code.FEW_SETS in explained_by(each.finding.code)
        ]
        if not ends:
            return None
        since = max(ends) + SETTLES
        share = facts.figures.shares(since).value
        return since if share is not None and share < FEW else None


def _is_of_own_stamps(finding: Finding, facts: GroupFacts) -> bool:
    """Whether the stamps of an input alone show what is found, and not how they compare with those of others."""
    about = finding.input
    return finding.code is Code.OTHER_CLOCK and about is not None and facts.inputs[about].figures.reading is not None


def _is_why(finding: Finding) -> bool:
    """Whether a finding says why few sets leave."""
    return finding.code in MATCHING or (finding.explains and Code.FEW_SETS in explained_by(finding.code))


def judge(facts: GroupFacts) -> tuple[Finding, ...]:
    """Return what `Judge` says of one moment, knowing nothing of what was before."""
    return Judge().judge(facts)


def with_ok(facts: GroupFacts, found: tuple[Finding, ...]) -> tuple[Finding, ...]:
    """Add to what is not as usual that a group is well, or starts; in figures that cost more than all rules."""
    if facts.asleep or any(finding.severity is not Severity.OK for finding in found):
        return found
    figures, share = facts.figures, facts.figures.share
    code, severity = Code.STARTING, Severity.OK if facts.standing is Standing.ENOUGH else Severity.WARN
    if figures.last_set is None:
        text = f"no set yet, {words.seconds(figures.now - figures.began)} after the start"
    elif facts.is_silent:
        required = (each for each in facts.inputs if each.required)
        last_back = max(required, key=lambda each: max(each.served_since or 0, each.figures.flows_since or 0)).name
        text = f"no set for {words.seconds(figures.now - figures.last_set)}, but {last_back} just came back"
    elif share.value is None and share.left < share.possible:
        text = f"{share.left} of {share.possible} possible sets so far, which is too soon to judge"
        severity = Severity.OK
    elif facts.is_look and share.value is None and share.unsteady is not None:
        few = facts.inputs[share.unsteady].name
        sets = counted(figures.sets, "set")
        text, severity = f"{sets} so far, but too few messages of {few} to tell how many were possible", Severity.OK
    else:
        code, severity = Code.HEALTHY, Severity.OK
        sets = f"{words.figure(figures.rate_hz)} of {words.figure(max(facts.possible_hz, figures.rate_hz))}"
        span, latency = (words.duration(each.quantile(0.95)) for each in (figures.spans, figures.latencies))
        text = f"{sets} possible sets a second, span {span} and latency {latency} at the 95th percentile"
    return (*found, Finding(code, severity, text))


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
        f"messages arrive on all inputs, but no set leaves: {fates}",
        rules_matching.more_sets(facts, Code.UNEXPLAINED)
        or "run `syncrelay doctor --config FILE --live`, which checks the graph and the stamps",
    )
