"""Answers `syncrelay tap`: each tap asks again and again for the sets and drops since it last asked.

A tap has a name of its own choice. Each answer is short and complete, so no tap occupies a thread of the server, and
one that stalls loses lines instead of holding up the relay.
"""

import json
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Self
from urllib.parse import parse_qs

from syncrelay.config import GroupConfig
from syncrelay.config.wording import one_of
from syncrelay.errors import SyncRelayError
from syncrelay.explain import GroupLines, GroupReport, Left, RecentDrop, Tape
from syncrelay.explain.tape import UNHEARD_S
from syncrelay.runtime import SYSTEM, Runtime
from syncrelay.sync import DropReason

MOST_TAPS: Final = 64
# All taps together get this share of a core, because the receive thread needs the interpreter too; unused time is
# saved up for a second.
_SHARE: Final = 0.2
# Written in a few milliseconds, for which the receive thread may have to wait for the interpreter.
_MOST_LINES: Final = 500
_KEYS: Final = ("tap", "after", "group", "drops", "input", "reason")
_MOST_FIELDS: Final = 64
# Far more than a relay has at once; reloads replace groups.
_GROUPS_KEPT: Final = 1_000
_NAME: Final = re.compile(r"[0-9A-Za-z]{1,32}")
_NUMBER: Final = re.compile(r"[0-9]{1,18}")


class TapRefusedError(SyncRelayError):
    """A tap is refused with this HTTP status and this sentence."""

    def __init__(self, status: str, sentence: str) -> None:
        super().__init__(sentence)
        self.status = status


@dataclass(frozen=True, slots=True)
class Wanted:
    """Which sets and drops a tap wants; an empty choice is all. `reasons` and `drops` leave out the sets."""

    groups: frozenset[str]
    inputs: Collection[str]
    reasons: Collection[str]
    drops: bool

    @property
    def is_all(self) -> bool:
        """Whether every set and drop is wanted."""
        return not (self.groups or self.inputs or self.reasons or self.drops)

    def holds(self, each: Left, topics: Collection[str]) -> bool:
        """Whether a set or drop is wanted, of a group with these input topics."""
        if self.is_all:
            return True
        outcome = each.outcome
        if self.groups and each.group.name not in self.groups:
            return False
        if isinstance(outcome, RecentDrop):
            named = [topic for index, topic in enumerate(topics) if index == outcome.input]
            return self._wants_input(named) and (not self.reasons or outcome.reason.value in self.reasons)
        there = [topic for topic, stamp in zip(topics, outcome, strict=True) if stamp is not None]
        return not self.reasons and not self.drops and self._wants_input(there)

    def _wants_input(self, topics: Collection[str]) -> bool:
        return not self.inputs or any(topic in self.inputs for topic in topics)


@dataclass(frozen=True, slots=True)
class Query:
    """A tap's question: its name, the number of the last line that it has (None at first), and what it wants."""

    name: str
    after: int | None
    wanted: Wanted

    @classmethod
    def of(cls, text: str) -> Self:
        """Read the query of a URL. Raises TapRefusedError."""
        try:
            fields = parse_qs(text, max_num_fields=_MOST_FIELDS, errors="strict")
        except ValueError as error:
            raise _bad("this is not a valid /tap query") from error
        for key in fields:
            if key not in _KEYS:
                raise _bad(f"there is no {key!a}: expected {', '.join(_KEYS)}")
        name, after = fields.get("tap", [""])[-1], fields.get("after", [None])[-1]
        if not _NAME.fullmatch(name):
            raise _bad("expected `tap`: a name of your choice, of up to 32 letters and digits")
        if after is not None and not _NUMBER.fullmatch(after):
            raise _bad("expected `after`: the number that the last answer gave")
        reasons = frozenset(fields.get("reason", ()))
        if not reasons <= {each.value for each in DropReason}:
            raise _bad(f"expected as `reason` one of {', '.join(each.value for each in DropReason)}")
        groups, inputs = frozenset(fields.get("group", ())), frozenset(fields.get("input", ()))
        wanted = Wanted(groups, inputs, reasons, drops=fields.get("drops", ["0"])[-1] != "0")
        return cls(name, None if after is None else int(after), wanted)


def _bad(sentence: str) -> TapRefusedError:
    return TapRefusedError("400 Bad Request", sentence)


def _require_known(wanted: frozenset[str], groups: Collection[str]) -> None:
    unknown = sorted(wanted.difference(groups))
    if groups and unknown:
        raise _bad(f"there is no group {unknown[0]!a}: expected {one_of(groups)}")


class Taps:
    """Answers taps, on any thread. `full_name` gives a topic's name in the graph."""

    def __init__(self, tape: Tape, full_name: Callable[[str], str], *, runtime: Runtime = SYSTEM) -> None:
        self.tape = tape
        self._full_name = full_name
        self._lines: dict[int, GroupLines] = {}
        self._runtime = runtime
        self._left_s, self._refilled = _SHARE, self._runtime.monotonic()
        self._asked: dict[str, float] = {}
        self._lock = runtime.lock()

    def answer(self, text: str, *, reports: Callable[[], Mapping[str, GroupReport | None]] = dict) -> bytes:
        """Return the sets and drops since the last answer as JSON. Raises TapRefusedError.

        `reports` gives the latest report of each group by its name, None before the first one. A new tap is refused
        if it names another group. A tap that goes on is not: a reload may have removed its group and may bring it
        back.

        In the answer `after` is the number to ask with next, and `more` says whether there is more at once. `lost`
        counts sets and drops of all groups that were discarded before they could be given, null if nobody counted.
        While taps have used up their share of the processor, no lines are given.
        """
        query = Query.of(text)
        # Asking for the state is costly, so only new taps do.
        if query.after is None and query.wanted.groups:
            _require_known(query.wanted.groups, reports())
        was_there = self._enter(query.name)
        last = self.tape.last
        if query.after is None or not was_there or query.after > last:
            return _answer(last, lost=0 if query.after is None else None)
        if not self._may_go_on():
            return _answer(query.after)
        began = self._runtime.thread_time_ns()
        left, lost = self.tape.after(query.after, most=_MOST_LINES)
        after = left[-1].number if left else query.after
        judged = reports() if left else {}
        lines = [line for each in left if (line := self._line(each, query.wanted, judged)) is not None]
        answer = _answer(after, more=after < last, lost=lost, lines=lines)
        with self._lock:
            self._left_s -= (self._runtime.thread_time_ns() - began) / 1e9
        return answer

    def _may_go_on(self) -> bool:
        now = self._runtime.monotonic()
        with self._lock:
            self._left_s = min(_SHARE, self._left_s + _SHARE * (now - self._refilled))
            self._refilled = now
            return self._left_s > 0

    def _enter(self, name: str) -> bool:
        """Keep the tape running for a tap. Returns whether it has been running since this tap last asked."""
        now = self._runtime.monotonic()
        with self._lock:
            self._asked = {each: asked for each, asked in self._asked.items() if now - asked < UNHEARD_S}
            was_there = name in self._asked and self.tape.is_on
            if name not in self._asked and len(self._asked) >= MOST_TAPS:
                raise TapRefusedError(
                    "503 Service Unavailable", f"{MOST_TAPS} taps follow this relay already: end one of them first"
                )
            self._asked[name] = now
            self.tape.listen()
        return was_there

    def _line(self, each: Left, wanted: Wanted, judged: Mapping[str, GroupReport | None]) -> str | None:
        lines = self._lines_of(each.group)
        if not wanted.holds(each, lines.topics):
            return None
        if isinstance(each.outcome, RecentDrop):
            report = judged.get(each.group.name)
            drop = each.outcome if report is None else report.told(each.outcome)
            return lines.of_drop(drop, left=each.left, received=each.received)
        return lines.of_set(each.outcome, left=each.left, received=each.received)

    def _lines_of(self, group: GroupConfig) -> GroupLines:
        # By identity: hashing a group goes through all of its options.
        lines = self._lines.get(id(group))
        if lines is None or lines.group is not group:
            if len(self._lines) >= _GROUPS_KEPT:
                self._lines.clear()
            lines = self._lines[id(group)] = GroupLines(group, [self._full_name(each.topic) for each in group.topics])
        return lines


def _answer(after: int, *, more: bool = False, lost: int | None = 0, lines: Sequence[str] = ()) -> bytes:
    head = json.dumps({"after": after, "more": more, "lost": lost})
    return f'{head[:-1]}, "lines": [{", ".join(lines)}]}}'.encode()
