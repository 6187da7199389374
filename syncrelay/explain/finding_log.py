"""When to say that a group is silent: not at once, not at every poll, and once when it is over."""

from collections.abc import Collection, Iterator
from typing import Final, NamedTuple

from syncrelay.explain import words
from syncrelay.explain.codes import Code, Severity
from syncrelay.explain.facts import GroupFacts
from syncrelay.explain.findings import Finding
from syncrelay.explain.judge import explanation
from syncrelay.explain.rules_stamps import may_drift
from syncrelay.explain.standing import Standing

_SECOND: Final = 1_000_000_000
_LONGEST_PAUSE: Final = 600 * _SECOND
# A warning has to last this long to be worth a line, and to be gone this long to be worth another.
_LASTING: Final = 5 * _SECOND
_FORGOTTEN: Final = 60 * _SECOND
# It is over when it has been gone for this long.
_OVER: Final = 10 * _SECOND
# What to write against it is worth this wait, where the relay had no time yet to try anything.
_UNTIL_TRIED: Final = 10 * _SECOND


# Who pauses a relay is told so at once.
_TOLD_ELSEWHERE: Final = frozenset({Code.PAUSED})
_OF_DRIFT: Final = frozenset({Code.UNEXPLAINED, Code.OVER_SLOP, Code.CONSTANT_OFFSET, Code.FEW_SETS})


class Remark(NamedTuple):
    """A line for the log, and the findings that it is about: none where it says that sets leave again.

    Of a silence it says the first, and is about all that keep sets from leaving.
    """

    severity: Severity
    text: str
    findings: tuple[Finding, ...] = ()

    @property
    def code(self) -> Code | None:
        """The code of what it is about."""
        return self.findings[0].code if self.findings else None


class FindingLog:
    """Turns the findings of one group, poll by poll, into what is worth saying."""

    def __init__(self) -> None:
        self._now = 0
        self._quiet_since: int | None = None
        self._told = False
        self._pause = 0
        self._tell_again = 0
        self._well_since = 0
        self._warned: dict[tuple[Code, int | None], _Warning] = {}

    def remarks(
        self, facts: GroupFacts, findings: tuple[Finding, ...], explained: Collection[Code] = ()
    ) -> Iterator[Remark]:
        """Yield what is to be said now; findings that all is well may be left out.

        What is `explained` by others is not over where it is not found.
        """
        now = facts.figures.now
        if now < self._now:
            self._set_back(self._now - now)
        self._now = now
        if facts.asleep:
            # That no set leaves is as it should be, and that nothing is found no sign that anything is over.
            self._quiet_since, self._told = None, False
            for (code, _), warning in self._warned.items():
                warning.holds = warning.holds and code not in explained
        if facts.is_silent:
            worst = explanation(findings) if findings else None
            if worst is not None and worst.severity is Severity.ERROR:
                errors = (each for each in findings if each.severity is Severity.ERROR)
                yield from self._silent(facts, (worst, *(each for each in errors if each is not worst)), now)
            # What only warns is not why no set leaves: its messages have just begun to come.
            if worst is None or worst.severity is not Severity.WARN:
                return
        last = facts.figures.last_set
        # After a pause, a group is not silent though no set has left yet.
        is_back = last is not None and self._quiet_since is not None and last > self._quiet_since
        if self._quiet_since is not None and is_back and facts.standing is Standing.ENOUGH:
            if self._told:
                yield Remark(Severity.OK, f"recovered after {words.seconds(now - self._quiet_since)}")
            self._quiet_since, self._told, self._well_since = None, False, now
        yield from self._warnings(facts, findings, explained, now)

    def _set_back(self, by: int) -> None:
        """Bear that this machine's clock was set back: else nothing would be said until it comes to where it was."""
        if self._quiet_since is not None:
            self._quiet_since -= by
        self._tell_again -= by
        self._well_since -= by
        for warning in self._warned.values():
            warning.began -= by
            warning.seen -= by

    def _silent(self, facts: GroupFacts, errors: tuple[Finding, ...], now: int) -> Iterator[Remark]:
        finding = errors[0]
        if self._quiet_since is None:
            last = facts.figures.last_set
            self._quiet_since = facts.figures.began if last is None else last
            # A group that comes and goes is not told anew each time: the pauses grow on until it was well for long.
            if now - self._well_since > _FORGOTTEN:
                self._pause, self._tell_again = 0, now
        if now < self._tell_again:
            return
        if finding.code in _OF_DRIFT and may_drift(facts):
            # The cause may be known soon.
            return
        if _awaits_a_try(facts, finding) and now - self._tell_again < _UNTIL_TRIED:
            return
        self._pause = min(2 * self._pause, _LONGEST_PAUSE) if self._pause else now - self._quiet_since
        self._tell_again = now + self._pause
        self._told = True
        # What explains a silence needs no line of its own when the silence is over.
        warning = self._warned.setdefault((finding.code, finding.input), _Warning(finding, now))
        warning.told, warning.holds, warning.seen = True, False, now
        quiet = words.seconds(facts.silent_for)
        ever = "no set" if facts.figures.last_set is None else "no more sets"
        yield Remark(Severity.WARN, f"{ever} for {quiet}: {in_words(finding)}", errors)

    def _warnings(
        self, facts: GroupFacts, findings: tuple[Finding, ...], explained: Collection[Code], now: int
    ) -> Iterator[Remark]:
        for finding in findings:
            if finding.severity is Severity.OK:
                # No longer worth a warning is not over.
                if (known := self._warned.get((finding.code, finding.input))) is not None:
                    known.seen = now
                continue
            if finding.is_over or finding.code in _TOLD_ELSEWHERE:
                continue
            warning = self._warned.setdefault((finding.code, finding.input), _Warning(finding, now))
            warning.see(finding, now)
            if finding.code in _OF_DRIFT and may_drift(facts):
                # The cause may be known soon.
                warning.began = now
            if not warning.told and now - warning.began >= _lasting(facts, finding):
                warning.told = warning.holds = True
                yield Remark(Severity.WARN, in_words(finding), (finding,))
        for (code, _), warning in self._warned.items():
            if warning.holds and code in explained:
                # It may be so still: it is not looked for.
                warning.seen = now
            if warning.holds and now - warning.seen >= _OVER:
                warning.holds = False
                text = f"resolved {words.seconds(now - warning.seen)} ago: {warning.finding.text}"
                yield Remark(Severity.OK, text, (warning.finding,))


def _awaits_a_try(facts: GroupFacts, finding: Finding) -> bool:
    return facts.evaluator is not None and facts.evaluator.awaits((finding.code, finding.input))


def _lasting(facts: GroupFacts, finding: Finding) -> int:
    """Return for how long a finding has to hold to be worth a line."""
    # What was missed once is missing from the share for as long.
    missing = facts.figures.share.ns if finding.code is Code.FEW_SETS else 0
    return _LASTING + missing + (_UNTIL_TRIED if _awaits_a_try(facts, finding) else 0)


class _Warning:
    """Since when something is so, when it was last found and how, whether it has been said, and no end of it yet."""

    def __init__(self, finding: Finding, now: int) -> None:
        self.began = self.seen = now
        self.finding = finding
        self.told = self.holds = False

    def see(self, finding: Finding, now: int) -> None:
        """Take note that it is so: anew, if it was not for long."""
        if now - self.seen > _FORGOTTEN:
            self.began, self.told = now, False
        elif finding.code is Code.FEW_SETS and now - self.seen > _OVER:
            self.began = now
        self.seen, self.finding = now, finding


def in_words(finding: Finding) -> str:
    """Return a finding with its suggestion, as one line."""
    return f"{finding.text}; {finding.suggestion}" if finding.suggestion else finding.text
