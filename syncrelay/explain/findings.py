"""What a finding is, and what every rule that makes them needs."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple, TypeAlias

from syncrelay.explain.changes import Changes
from syncrelay.explain.codes import Code, Severity
from syncrelay.explain.facts import GroupFacts, InputFacts

SECOND: Final = 1_000_000_000
# What has been away for so long was said, and is no news.
_USUAL: Final = 60 * SECOND


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that is so: a sentence with its figures, and what to do, None where nothing is to be done.

    `input` is the index of the input that it is about, None where it is about the group, or about several: these are
    `inputs`. `explains` is False where it is too small to explain other findings. `is_over` says that it was so until
    some seconds ago, and that the sets that it cost are still missing from the share.
    """

    code: Code
    severity: Severity
    text: str
    suggestion: str | None = None
    input: int | None = None
    explains: bool = True
    inputs: tuple[int, ...] = ()
    is_over: bool = False

    @property
    def about(self) -> tuple[int, ...]:
        """The indices of all inputs that it is about, none where it is about the group."""
        return self.inputs if self.input is None else (self.input,)


class Fault(NamedTuple):
    """What a rule finds: a finding but for its code, which the judge's table has beside the rule."""

    text: str
    suggestion: str | None = None
    severity: Severity = Severity.WARN
    input: int | None = None
    explains: bool = True
    inputs: tuple[int, ...] = ()


Found: TypeAlias = Iterator[Fault]


class Rule(NamedTuple):
    """How faults of one code are found: none where all inputs are as `unless_all` says, which costs less to see."""

    code: Code
    find: Callable[[GroupFacts], Iterable[Fault]]
    unless_all: Callable[[InputFacts], bool] | None = None

    def findings(self, facts: GroupFacts) -> Iterator[Finding]:
        """Yield what it finds."""
        for text, suggestion, severity, about, explains, inputs in self.find(facts):
            yield Finding(self.code, severity, text, suggestion, about, explains, inputs)


def found_by(rules: Iterable[Rule], facts: GroupFacts) -> Iterator[Finding]:
    """Yield what rules find, of which only those are asked that may find something."""
    are_all: dict[Callable[[InputFacts], bool], bool] = {}
    for rule in rules:
        if (unless_all := rule.unless_all) is not None:
            if unless_all not in are_all:
                are_all[unless_all] = all(map(unless_all, facts.inputs))
            if are_all[unless_all]:
                continue
        yield from rule.findings(facts)


def of_each_input(
    code: Code,
    rule: Callable[[GroupFacts, int, InputFacts], Found],
    unless_all: Callable[[InputFacts], bool] | None = None,
) -> Rule:
    """Make a rule about an input one about a group, the required inputs first."""

    def find(facts: GroupFacts) -> list[Fault]:
        inputs = facts.inputs
        return [
            fault._replace(input=index) for index in facts.required_first for fault in rule(facts, index, inputs[index])
        ]

    return Rule(code, find, unless_all)


def blocks(facts: GroupFacts, an_input: InputFacts) -> Severity:
    """Return how bad it is that an input gives nothing."""
    return Severity.ERROR if an_input.required and facts.is_silent else Severity.WARN


def absence(facts: GroupFacts, an_input: InputFacts) -> Severity:
    """Return how bad it is that an input is away: a minute later, a group without an optional one is as usual.

    Not one without an input that counts for its quorum: there is one less to lose.
    """
    away = facts.figures.now - max(facts.figures.began, an_input.figures.last_received or 0)
    is_usual = not (an_input.required or an_input.in_quorum or facts.is_recorded) and away >= _USUAL
    return Severity.OK if is_usual else blocks(facts, an_input)


def counted(count: int, fed: int) -> str:
    """Return `3 of the last 100`, or `all 100`."""
    return f"all {count}" if count >= fed else f"{count} of the last {fed}"


def nodes(an_input: InputFacts) -> str:
    """Return the names of those who publish an input."""
    return " and ".join(dict.fromkeys(each.node for each in an_input.graph.publishers)) or "its publisher"


def written(facts: GroupFacts, changes: Changes) -> str:
    """Return changes as they stand in the file, with the input that they are for behind the last of those of one."""
    parts = []
    for each, after in zip(changes, (*changes[1:], None), strict=True):
        is_last = each.input is not None and (after is None or after.input != each.input)
        where = f" at {facts.inputs[each.input].name}" if is_last and each.input is not None else ""
        parts.append(f"`{each.key}: {each.value}`{where}")
    return " and ".join(parts)
