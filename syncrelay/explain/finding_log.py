"""When the log says that a group is silent: after a while, not at every poll, and once more when it recovers."""

from collections import deque
from collections.abc import Collection, Iterator
from typing import Final, NamedTuple

from syncrelay.explain import words
from syncrelay.explain.codes import Code, Severity
from syncrelay.explain.facts import GroupFacts
from syncrelay.explain.findings import Finding
from syncrelay.explain.judge import explanation
from syncrelay.explain.known_soon import known_soon
from syncrelay.explain.standing import Standing

_SECOND: Final = 1_000_000_000
_LONGEST_PAUSE: Final = 600 * _SECOND
# A warning is logged once it has lasted this long, and again only if it was away for this long.
_LASTING: Final = 5 * _SECOND
_FORGOTTEN: Final = 60 * _SECOND
# A warning is over when it has been away for this long.
_OVER: Final = 10 * _SECOND
# While the relay has not yet tried a value, a line waits this long for the suggestion.
_UNTIL_TRIED: Final = 10 * _SECOND

# Of what is over, so much is kept for the summary at the end.
_KEPT: Final = 5

# Whoever pauses a relay gets an answer at once, so the log need not repeat it.
_NOT_LOGGED: Final = frozenset({Code.PAUSED})


class Remark(NamedTuple):
    """A line for the log and the findings it is about; none if it says that the group recovered.

    For a silence, the line words the first finding, and `findings` are all that keep sets from leaving.
    """

    severity: Severity
    text: str
    findings: tuple[Finding, ...] = ()

    @property
    def code(self) -> Code | None:
        """The code of the first finding."""
        return self.findings[0].code if self.findings else None


class Spell(NamedTuple):
    """Something that was wrong with a group and was logged: how long after the start it began, how long it lasted.

    In nanoseconds; `lasted` is None of what still holds.
    """

    after: int
    lasted: int | None
    text: str


class FindingLog:
    """Turns the findings of one group, poll by poll, into remarks for the log."""

    def __init__(self) -> None:
        self._now = 0
        self._quiet_since: int | None = None
        self._is_silence_logged = False
        self._pause = 0
        self._log_again = 0
        self._well_since = 0
        self._warned: dict[tuple[Code, int | None], _Warning] = {}
        self._start: int | None = None
        self._silence = ""
        self._over: deque[Spell] = deque(maxlen=_KEPT)
        self._n_over = 0
        # When sets began to leave again, though not enough of them yet to call it over.
        self._back_at: int | None = None

    @property
    def n_left_out(self) -> int:
        """How many spells are over that are not in `spells`."""
        return self._n_over - len(self._over)

    @property
    def spells(self) -> tuple[Spell, ...]:
        """What was wrong, in the order in which it ended; what still holds comes last."""
        holds = [(each.began, each.finding.text) for each in self._warned.values() if each.holds]
        start = self._start or 0
        spells = [*self._over, *(Spell(began - start, None, text) for began, text in holds)]
        if self._is_silence_logged and self._quiet_since is not None:
            lasted = None if self._back_at is None else self._back_at - self._quiet_since
            spells.append(Spell(self._quiet_since - start, lasted, self._silence))
        return tuple(spells)

    def _end(self, began: int, ended: int, text: str) -> None:
        self._over.append(Spell(began - (self._start or 0), ended - began, text))
        self._n_over += 1

    def remarks(
        self, facts: GroupFacts, findings: tuple[Finding, ...], explained: Collection[Code] = ()
    ) -> Iterator[Remark]:
        """Yield the remarks that are due; `findings` need not contain those that say that all is well.

        Codes that are `explained` by other findings are hidden, so their absence does not mean that they are over.
        """
        now = facts.figures.now
        if self._start is None:
            self._start = facts.figures.began
        if now < self._now:
            self._set_back(self._now - now)
        self._now = now
        if facts.asleep:
            # A sleeping group should give no sets, and finds nothing: neither is worth a line.
            self._quiet_since, self._is_silence_logged = None, False
            for (code, _), warning in self._warned.items():
                warning.holds = warning.holds and code not in explained
        if facts.is_silent:
            self._back_at = None
            worst = explanation(findings) if findings else None
            if worst is not None and worst.severity is Severity.ERROR:
                errors = (each for each in findings if each.severity is Severity.ERROR)
                yield from self._silent(facts, (worst, *(each for each in errors if each is not worst)), now)
            # A mere warning does not explain a silence: the messages have only just begun to come.
            if worst is None or worst.severity is not Severity.WARN:
                return
        last = facts.figures.last_set
        # After a pause a group does not count as silent, even before its first set.
        is_back = last is not None and self._quiet_since is not None and last > self._quiet_since
        if self._quiet_since is not None and is_back and facts.standing is Standing.ENOUGH:
            if self._is_silence_logged:
                self._end(self._quiet_since, now, self._silence)
                yield Remark(Severity.OK, f"recovered after {words.seconds(now - self._quiet_since)}")
            self._quiet_since, self._is_silence_logged, self._well_since = None, False, now
        self._back_at = (self._back_at or last) if self._quiet_since is not None and is_back else None
        yield from self._warnings(facts, findings, explained, now)

    def _set_back(self, by: int) -> None:
        """Shift all times by as much as the machine's clock was set back, so that remarks go on at once."""
        if self._start is not None:
            self._start -= by
        if self._quiet_since is not None:
            self._quiet_since -= by
        if self._back_at is not None:
            self._back_at -= by
        self._log_again -= by
        self._well_since -= by
        for warning in self._warned.values():
            warning.began -= by
            warning.seen -= by

    def _silent(self, facts: GroupFacts, errors: tuple[Finding, ...], now: int) -> Iterator[Remark]:
        finding = errors[0]
        if self._quiet_since is None:
            last = facts.figures.last_set
            self._quiet_since = facts.figures.began if last is None else last
            # For a group that comes and goes the pauses keep growing, until it was well for long.
            if now - self._well_since > _FORGOTTEN:
                self._pause, self._log_again = 0, now
        if now < self._log_again:
            return
        if known_soon(facts, finding.code) and now - self._log_again < _UNTIL_TRIED:
            # The cause may be known soon.
            return
        if _awaits_a_try(facts, finding) and now - self._log_again < _UNTIL_TRIED:
            return
        self._pause = min(2 * self._pause, _LONGEST_PAUSE) if self._pause else now - self._quiet_since
        self._log_again = now + self._pause
        self._is_silence_logged = True
        self._silence = f"no sets: {finding.text}"
        # The cause of a silence needs no line of its own after the silence is over.
        warning = self._warned.setdefault((finding.code, finding.input), _Warning(finding, now))
        warning.is_logged, warning.holds, warning.seen = True, False, now
        quiet = words.seconds(facts.silent_for)
        ever = "no set" if facts.figures.last_set is None else "no more sets"
        yield Remark(Severity.WARN, f"{ever} for {quiet}: {in_words(finding)}", errors)

    def _warnings(
        self, facts: GroupFacts, findings: tuple[Finding, ...], explained: Collection[Code], now: int
    ) -> Iterator[Remark]:
        for finding in findings:
            if finding.severity is Severity.OK:
                # A finding that no longer warns may still be there.
                if (known := self._warned.get((finding.code, finding.input))) is not None:
                    known.seen = now
                continue
            if finding.is_over or finding.code in _NOT_LOGGED:
                continue
            warning = self._warned.setdefault((finding.code, finding.input), _Warning(finding, now))
            warning.see(finding, now)
            # One missed set lowers the share for the length of the window.
            missing = facts.figures.share.ns if finding.code is Code.FEW_SETS else 0
            may_be_known = known_soon(facts, finding.code)
            until_tried = _UNTIL_TRIED if may_be_known or _awaits_a_try(facts, finding) else 0
            if not warning.is_logged and now - warning.began >= _LASTING + missing + until_tried:
                warning.is_logged = warning.holds = True
                yield Remark(Severity.WARN, in_words(finding), (finding,))
        for (code, _), warning in self._warned.items():
            if warning.holds and code in explained:
                # It is hidden by another finding, so it may still hold.
                warning.seen = now
            if warning.holds and now - warning.seen >= _OVER:
                warning.holds = False
                self._end(warning.began, warning.seen, warning.finding.text)
                text = f"resolved {words.seconds(now - warning.seen)} ago: {warning.finding.text}"
                yield Remark(Severity.OK, text, (warning.finding,))


def _awaits_a_try(facts: GroupFacts, finding: Finding) -> bool:
    return facts.suggester is not None and facts.suggester.awaits((finding.code, finding.input))


class _Warning:
    """A finding over time: when it began, when it was last seen, whether it was logged, and whether it still holds."""

    def __init__(self, finding: Finding, now: int) -> None:
        self.began = self.seen = now
        self.finding = finding
        self.is_logged = self.holds = False

    def see(self, finding: Finding, now: int) -> None:
        """Note that it was found; after a long absence it counts as new."""
        if now - self.seen > _FORGOTTEN:
            self.began, self.is_logged = now, False
        elif finding.code is Code.FEW_SETS and now - self.seen > _OVER:
            self.began = now
        self.seen, self.finding = now, finding


def in_words(finding: Finding) -> str:
    """Return a finding with its suggestion, as one line."""
    return f"{finding.text}; {finding.suggestion}" if finding.suggestion else finding.text
