"""One log line for each cause, however many groups it affects: it names the node and counts the groups."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from syncrelay.explain.codes import Code, Severity
from syncrelay.explain.facts import GroupFacts
from syncrelay.explain.finding_log import Remark
from syncrelay.explain.findings import Finding
from syncrelay.explain.troubles import Found, Origin, named, sentence, topics_by_cause, worst_first

_SECOND: Final = 1_000_000_000
# Lines wait until every group was judged, but no longer than this: a bug may have stopped a group.
_ROUND: Final = 5 * _SECOND
# After a cause is gone, groups recover one after the other. One line names all that recover within this time.
_UNTIL_ALL_ARE_BACK: Final = 30 * _SECOND
# The first reminder comes after this pause, each further one after twice the pause before it.
_FIRST_PAUSE: Final = 5 * _SECOND
_LONGEST_PAUSE: Final = 600 * _SECOND
# Groups are judged about once a second, so a reminder may come this much early.
_EARLY: Final = _SECOND
_FORGOTTEN: Final = 60 * _SECOND
# With these codes, every group that uses the topic is affected, even one that was not yet found to be.
_GIVES_NOTHING: Final = frozenset({Code.SILENT, Code.NO_PUBLISHER})


class Line(NamedTuple):
    """A line for the log, and the groups and the code that it is about."""

    severity: Severity
    text: str
    groups: tuple[str, ...]
    code: Code | None


class _Said:
    """What the log said about a cause: the topics and groups it named, and when it may be repeated."""

    def __init__(self) -> None:
        self.topics: frozenset[str] = frozenset()
        self.groups: frozenset[str] = frozenset()
        self.pause = _FIRST_PAUSE
        self.at = self.again = self.heard = 0


class _End:
    """The groups in which a cause is over while it lasts in others."""

    def __init__(self, now: int) -> None:
        self.since = now
        self.groups: list[str] = []
        self.remark = Remark(Severity.OK, "")


class CauseLog:
    """Merges the remarks of all groups into one line for each cause.

    `now` is in nanoseconds, of a clock that is never set back.
    """

    def __init__(self) -> None:
        self._found: dict[str, tuple[GroupFacts, tuple[Finding, ...]]] = {}
        self._heard: dict[str, int] = {}
        self.published_by: dict[str, str] = {}
        """Which node publishes a topic, or did when it was last seen."""
        self._waiting: list[tuple[str, Remark]] = []
        self._since = 0
        self._said: dict[Origin, _Said] = {}
        self._hit: dict[tuple[Origin, Code | None], set[str]] = {}
        self._silenced_by: dict[str, Origin] = {}
        self._ends: dict[tuple[Origin, Code | None], _End] = {}

    def watch(self, groups: Iterable[str]) -> None:
        """Forget all groups but these."""
        names = set(groups)
        self._found = {name: found for name, found in self._found.items() if name in names}
        self._waiting = [each for each in self._waiting if each[0] in names]
        self._hit = {key: hit & names for key, hit in self._hit.items()}
        # A group that has not been judged yet counts as heard at 0, so lines wait for it.
        self._heard = {name: self._heard.get(name, 0) for name in names}

    def hear(self, facts: GroupFacts, findings: tuple[Finding, ...], remarks: Iterable[Remark], *, now: int) -> None:
        """Take the findings of a group, and the remarks that its own log would make."""
        self._found[facts.name] = facts, findings
        self._heard[facts.name] = now
        for each in facts.inputs:
            if names := {publisher.node for publisher in each.graph.publishers if publisher.is_named}:
                self.published_by[each.name] = " and ".join(sorted(names))
        for remark in remarks:
            self._wait([(facts.name, remark)], now)

    def _wait(self, remarks: Sequence[tuple[str, Remark]], now: int) -> None:
        if not self._waiting:
            self._since = now
        self._waiting += remarks

    def lines(self, *, now: int, is_last: bool = False) -> Iterator[Line]:
        """Yield the lines that are due: once every group was judged after the first remark came in."""
        others = (at for name, at in self._heard.items() if self._waiting and name != self._waiting[0][0])
        is_complete = all(at > self._since for at in others) or now - self._since >= _ROUND
        if self._waiting and (is_last or is_complete):
            waiting, self._waiting = self._waiting, []
            yield from self._merged(waiting, now)
        for key, end in [*self._ends.items()]:
            if is_last or not self._hit.get(key) or now - end.since >= _UNTIL_ALL_ARE_BACK:
                del self._ends[key]
                if groups := [name for name in self._found if name in end.groups]:
                    yield _line(Severity.OK, end.remark.text, groups, end.remark.code)

    def _merged(self, waiting: Sequence[tuple[str, Remark]], now: int) -> Iterator[Line]:
        warned: dict[Origin, list[tuple[str, Remark]]] = {}
        for group, remark in waiting:
            if remark.severity is Severity.OK:
                self._end(group, remark, now)
                continue
            for cause in self._causes_of(group, remark):
                warned.setdefault(cause, []).append((group, remark))
        for cause, remarks in warned.items():
            yield from self._warn(cause, remarks, now)

    def _causes_of(self, group: str, remark: Remark) -> Sequence[Origin]:
        facts, _ = self._found[group]
        causes = dict.fromkeys(cause for each in remark.findings for cause in self._topics_by_cause(facts, each))
        is_silence = any(each.severity is Severity.ERROR for each in remark.findings)
        for cause in causes:
            self._hit.setdefault((cause, None if is_silence else cause.code), set()).add(group)
        if is_silence:
            self._silenced_by.setdefault(group, next(iter(causes)))
        return [*causes]

    def _warn(self, cause: Origin, remarks: Sequence[tuple[str, Remark]], now: int) -> Iterator[Line]:
        if cause.group:
            for group, remark in remarks:
                found, hit = self._found_then(cause, [(group, remark)]), [self._found[group][0]]
                yield _line(Severity.WARN, sentence(cause, found, hit), (group,), cause.code)
            return
        said = self._said.setdefault(cause, _Said())
        hit_by = {*self._hit.get((cause, None), ()), *self._hit.get((cause, cause.code), ())}
        if now - said.heard >= _FORGOTTEN and hit_by <= {group for group, _ in remarks}:
            said = self._said[cause] = _Said()
        said.heard = now
        found = self._found_of(cause) or self._found_then(cause, remarks)
        topics = frozenset(topic for each in found for topic in each.topics)
        hit = self._groups_of(cause, found, topics)
        groups = frozenset(each.name for each in hit)
        is_news = not (topics <= said.topics and groups <= said.groups)
        if said.groups and now + _EARLY < (said.at + _FIRST_PAUSE if is_news else said.again):
            if is_news:
                # Keep them for the next line: more groups may be found by then.
                self._wait(remarks, now)
            return
        said.topics, said.groups, said.at = said.topics | topics, said.groups | groups, now
        said.again, said.pause = now + said.pause, min(2 * said.pause, _LONGEST_PAUSE)
        yield _line(Severity.WARN, sentence(cause, found, hit), [each.name for each in hit], cause.code)

    def _found_of(self, cause: Origin) -> list[Found]:
        """Return the findings of a cause in all groups, the most severe first."""
        now = (
            (facts, finding)
            for facts, findings in self._found.values()
            for finding in findings
            if finding.code is cause.code and finding.severity is not Severity.OK and not finding.is_over
        )
        return worst_first(self._of_cause(cause, now))

    def _found_then(self, cause: Origin, remarks: Sequence[tuple[str, Remark]]) -> list[Found]:
        """Return the findings of the time of the remarks, which may be over by now."""
        then = ((self._found[group][0], finding) for group, remark in remarks for finding in remark.findings)
        return self._of_cause(cause, then)

    def _of_cause(self, cause: Origin, found: Iterable[tuple[GroupFacts, Finding]]) -> list[Found]:
        return [
            Found(facts, finding, topics)
            for facts, finding in found
            for each, topics in self._topics_by_cause(facts, finding).items()
            if each == cause
        ]

    def _topics_by_cause(self, facts: GroupFacts, finding: Finding) -> Mapping[Origin, tuple[str, ...]]:
        return topics_by_cause(facts, finding, self.published_by, self._found.values())

    def _groups_of(self, cause: Origin, found: Sequence[Found], topics: frozenset[str]) -> list[GroupFacts]:
        names = {each.facts.name for each in found}
        return [
            facts
            for facts, _ in self._found.values()
            if facts.name in names
            or (cause.code in _GIVES_NOTHING and not facts.asleep and any(each.name in topics for each in facts.inputs))
        ]

    def _end(self, group: str, remark: Remark, now: int) -> None:
        """Note that a group has recovered, or that one of its warnings is over."""
        facts, _ = self._found[group]
        if remark.findings:
            causes = [cause for each in remark.findings for cause in self._topics_by_cause(facts, each)]
        else:
            causes = [self._silenced_by.pop(group, Origin(None, group=group))]
        key = next(((cause, remark.code) for cause in causes), (Origin(None, group=group), remark.code))
        for (cause, code), hit in self._hit.items():
            if code is remark.code and (code is None or cause in causes):
                hit.discard(group)
        end = self._ends.setdefault(key, _End(now))
        end.groups.append(group)
        # The last group to recover was silent for the longest time: its remark is the one to show.
        end.remark = remark


def _line(severity: Severity, text: str, groups: Sequence[str], code: Code | None) -> Line:
    return Line(severity, f"{named(groups)}: {text}", tuple(groups), code)
