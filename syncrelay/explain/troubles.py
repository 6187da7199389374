"""What several groups suffer of at once: findings of one cause, in one sentence over the groups that it hits."""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Final, NamedTuple

from syncrelay.config.wording import all_of, counted
from syncrelay.explain import words
from syncrelay.explain.codes import OF_PUBLISHER, OF_RELAY, Code, Severity
from syncrelay.explain.facts import GroupFacts
from syncrelay.explain.findings import Finding
from syncrelay.explain.judge import explanation

_NAMED: Final = 3


class Origin(NamedTuple):
    """A code and what it belongs to: a node, a group, topics that may be misspelled, or otherwise the relay."""

    code: Code | None
    node: str = ""
    group: str = ""
    misnamed: tuple[str, ...] = ()


class Found(NamedTuple):
    """A finding of a cause in one group, and the topics of that group that it is about."""

    facts: GroupFacts
    finding: Finding
    topics: tuple[str, ...]


class Trouble(NamedTuple):
    """What is wrong at a moment, in how many groups it may be; `suggestion` says what to do."""

    severity: Severity
    code: Code
    text: str
    suggestion: str | None
    groups: tuple[str, ...]


def troubles(
    found: Sequence[tuple[GroupFacts, Sequence[Finding]]], published_by: Mapping[str, str]
) -> Sequence[Trouble]:
    """Return what is wrong with groups by their explanations, the worst first, and then what hits most of them.

    `published_by` names the node of a topic, even one that has gone.
    """
    by_cause: dict[Origin, list[Found]] = {}
    for facts, findings in found:
        first = explanation(tuple(findings)) if findings else None
        if first is None or first.severity is Severity.OK:
            continue
        for cause, topics in topics_by_cause(facts, first, published_by, found).items():
            by_cause.setdefault(cause, []).append(Found(facts, first, topics))
    return sorted(
        (_trouble(cause, worst_first(each)) for cause, each in by_cause.items()),
        key=lambda trouble: (-trouble.severity, -len(trouble.groups)),
    )


def _trouble(cause: Origin, found: Sequence[Found]) -> Trouble:
    hit, first = [each.facts for each in found], found[0].finding
    text = _text(cause, found, hit)
    return Trouble(first.severity, first.code, text, first.suggestion or None, tuple(each.name for each in hit))


def worst_first(found: Iterable[Found]) -> list[Found]:
    """Sort findings of one cause: the most severe first, and of these one about an input."""
    return sorted(found, key=lambda each: (-each.finding.severity, each.finding.input is None))


def topics_by_cause(
    facts: GroupFacts,
    finding: Finding,
    published_by: Mapping[str, str],
    found: Iterable[tuple[GroupFacts, Sequence[Finding]]],
) -> Mapping[Origin, tuple[str, ...]]:
    """Return the causes of a group's finding, each with its topics, beside what was found of all groups."""
    if not finding.about and finding.code in OF_RELAY:
        return {Origin(finding.code): ()}
    if not finding.about or finding.code not in OF_PUBLISHER:
        return {Origin(finding.code, group=facts.name): tuple(facts.inputs[index].name for index in finding.about)}
    topics = [facts.inputs[index].name for index in finding.about]
    nodes = [published_by.get(topic, "") for topic in topics]
    if len(set(nodes)) > 1 and finding.code is Code.SILENT and _is_all_silent(found):
        return {Origin(finding.code): tuple(topics)}
    by_cause: dict[Origin, tuple[str, ...]] = {}
    for topic, node in zip(topics, nodes, strict=True):
        # A suggested name fits one topic only, so each misspelled topic is a cause of its own.
        is_misnamed = not node and any(facts.inputs[index].graph.alike for index in finding.about)
        cause = Origin(finding.code, node, misnamed=tuple(topics) if is_misnamed else ())
        by_cause[cause] = (*by_cause.get(cause, ()), topic)
    return by_cause


def _is_all_silent(found: Iterable[tuple[GroupFacts, Sequence[Finding]]]) -> bool:
    """Whether no group receives anything: then the network, or a player of recordings, is the likely cause."""
    return all(
        any(each.code is Code.SILENT and len(each.about) == len(facts.inputs) for each in findings)
        for facts, findings in found
        if not facts.asleep
    )


def named(groups: Sequence[str]) -> str:
    """Return `front`, or `5 groups (front, rear, left and 2 more)`."""
    if len(groups) == 1:
        return groups[0]
    return f"{counted(len(groups), 'group')} ({listed(groups)})"


def listed(names: Sequence[str]) -> str:
    """Return `front and rear`, or `front, rear, left and 2 more`."""
    rest = len(names) - _NAMED
    return all_of(names if rest <= 1 else [*names[:_NAMED], f"{rest} more"])


def sentence(cause: Origin, found: Sequence[Found], hit: Sequence[GroupFacts]) -> str:
    """Return what a cause does to the groups that it hits, and what to do."""
    suggestion = found[0].finding.suggestion
    return _text(cause, found, hit, f"; {suggestion}" if suggestion else "")


def _text(cause: Origin, found: Sequence[Found], hit: Sequence[GroupFacts], to_do: str = "") -> str:
    """Word a cause as the worst affected group words it, then add the other topics, the node and the silence."""
    first, own = found[0].finding, found[0].topics
    text, said = first.text, f"{first.text} {first.suggestion}"
    others = [topic for topic in dict.fromkeys(each for one in found for each in one.topics) if topic not in own]
    is_shared = bool(others) or len(hit) > 1
    if others:
        text += f"; the same holds for {listed(others)}"
    elif is_shared and len(own) > 1 and not any(_names(text, topic) for topic in own):
        text += f": {listed(own)}"
    if is_shared and cause.node and not _names(said, cause.node):
        text += f"; {cause.node} published {'them' if others or len(own) > 1 else 'it'}"
    text += to_do
    silent = [each for each in hit if each.is_silent]
    if not silent:
        return text
    if len(silent) < len(hit):
        return f"{len(silent)} of them {'gives' if len(silent) == 1 else 'give'} no sets: {text}"
    ever = "no set" if all(each.figures.last_set is None for each in silent) else "no more sets"
    return f"{ever} for {words.seconds(max(each.silent_for for each in silent))}: {text}"


def _names(text: str, name: str) -> bool:
    """Whether a text contains a name, not merely as part of a longer one."""
    return re.search(rf"(?<![\w/]){re.escape(name)}(?![\w/])", text) is not None
