"""Faults that are applied to messages as they arrive: late, lost, stamped by a wrong clock, or none at all.

    late: /lidar/points 80ms            drop: /imu/data 10%
    offset: /camera/image_raw -12ms     drift: /camera/image_raw 100ppm
    dead: /lidar/points from 12s        each with `from 12s` and `until 20s`, to begin later or to end

The same faults, seed and messages give the same messages.
"""

import random
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from enum import Enum
from types import MappingProxyType
from typing import Final

from syncrelay.config.names import check_topic_name
from syncrelay.config.units import parse_duration_text
from syncrelay.config.wording import counted, did_you_mean, one_of, quoted

_MILLION: Final = 1_000_000
_BILLION: Final = 1_000_000_000
# No more digits than an amount holds, so that no small share silently becomes 0.
_SHARE: Final = re.compile(r"([0-9]{1,3}(?:\.[0-9]{1,4})?)\s*%")
_PARTS: Final = re.compile(r"([+-]?[0-9]{1,7}(?:\.[0-9]{1,3})?)\s*ppm")
MOST_LATE: Final = 60 * _BILLION
"""The longest delay of a topic in nanoseconds, as late messages are held in memory."""

_MOST_PARTS: Final = 100_000


class Kind(Enum):
    """What is wrong with a topic."""

    LATE = "late"
    DROP = "drop"
    OFFSET = "offset"
    DRIFT = "drift"
    DEAD = "dead"


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault of a topic, as it was `written`.

    `amount` is in nanoseconds for `late` and `offset`, millionths for `drop`, billionths for `drift`. The fault holds
    from `begin` until before `end`, in nanoseconds after the first message of all topics; None is no end.
    """

    kind: Kind
    topic: str
    amount: int
    begin: int
    end: int | None
    written: str

    def of_topic(self, topic: str) -> "Fault":
        """Return the same fault with another name of its topic."""
        return replace(self, topic=topic)

    def holds(self, since: int) -> bool:
        """Return whether it holds at a time in nanoseconds after the first message."""
        return since >= self.begin and (self.end is None or since < self.end)


def parse_fault(text: str) -> Fault:
    """Read a fault. Raises ValueError that says what to write instead."""
    name, colon, rest = text.partition(":")
    kinds = {kind.value: kind for kind in Kind}
    kind = kinds.get(name.strip())
    if not colon:
        raise ValueError(f"{quoted(text)} is not a fault, expected one such as {quoted(_EXAMPLES[Kind.LATE])}")
    if kind is None:
        hint = did_you_mean(name.strip(), kinds) or f", expected {one_of(kinds)}, as in `late: /lidar/points 80ms`"
        raise ValueError(f"{quoted(text)} is not a fault{hint}")
    words: Sequence[str]
    topic, *words = rest.split() or [""]
    if not topic:
        raise ValueError(f"{quoted(text)} names no topic, expected {quoted(_EXAMPLES[kind])}")
    check_topic_name(topic)
    amount, words = _amount(kind, words, text)
    begin, end = _window(words, text)
    return Fault(kind, topic, amount, begin, end, text)


_EXAMPLES: Final[Mapping[Kind, str]] = MappingProxyType(
    {
        Kind.LATE: "late: /lidar/points 80ms",
        Kind.DROP: "drop: /imu/data 10%",
        Kind.OFFSET: "offset: /camera/image_raw -12ms",
        Kind.DRIFT: "drift: /camera/image_raw 100ppm",
        Kind.DEAD: "dead: /lidar/points from 12s",
    }
)


def _duration(word: str) -> int:
    return parse_duration_text(word)[0]


def _late(word: str) -> int:
    delay = _duration(word)
    if not 0 <= delay <= MOST_LATE:
        raise ValueError(
            f"{quoted(word)} is out of range, expected 0 to 60s, because messages are held in memory for that long"
        )
    return delay


def parse_share(word: str) -> int:
    """Read a share such as 10% as millionths. Raises ValueError for any other text."""
    found = _SHARE.fullmatch(word)
    if found is None or float(found[1]) > 100:  # noqa: PLR2004  all there is
        raise ValueError(f"expected a share such as 10% (0% to 100%, at most 4 decimals), found {quoted(word)}")
    return round(float(found[1]) * _MILLION / 100)


def _drift(word: str) -> int:
    found = _PARTS.fullmatch(word)
    if found is None or abs(float(found[1])) > _MOST_PARTS:
        raise ValueError(
            f"expected a drift such as 100ppm (at most {_MOST_PARTS}ppm, 3 decimals), found {quoted(word)}"
        )
    return round(float(found[1]) * 1000)


_READERS: Final[Mapping[Kind, Callable[[str], int]]] = MappingProxyType(
    {Kind.LATE: _late, Kind.DROP: parse_share, Kind.OFFSET: _duration, Kind.DRIFT: _drift}
)


def _amount(kind: Kind, words: Sequence[str], text: str) -> tuple[int, Sequence[str]]:
    """Return the amount and the words after it. There may be a space before the unit."""
    reader = _READERS.get(kind)
    if reader is None:
        return 0, words
    until = next((at for at, word in enumerate(words) if word in ("from", "until")), len(words))
    if not until:
        raise ValueError(f"{quoted(text)} does not say how much, expected {quoted(_EXAMPLES[kind])}")
    return reader(" ".join(words[:until])), words[until:]


def _window(words: Sequence[str], text: str) -> tuple[int, int | None]:
    found: dict[str, int] = {}
    for word, moment in zip(words[::2], [*words[1::2], ""], strict=False):
        if word not in ("from", "until") or word in found:
            raise ValueError(f"{quoted(word)} in {quoted(text)}: expected `from 12s`, `until 20s` or both")
        found[word] = _duration(moment)
    begin, end = found.get("from", 0), found.get("until")
    if begin < 0 or (end is not None and end <= begin):
        raise ValueError(f"{quoted(text)} never applies: `from` must be 0s or later, and `until` later than `from`")
    return begin, end


def _plainly(drop: Fault) -> str:
    """Write a loss in one way, so that losses that mean the same lose the same messages."""
    share = f"{(Decimal(drop.amount) * 100 / _MILLION).normalize():f}"
    begin = f" from {_seconds(drop.begin)}s" if drop.begin else ""
    end = "" if drop.end is None else f" until {_seconds(drop.end)}s"
    return f"drop: {drop.topic} {share}%{begin}{end}"


def _seconds(nanoseconds: int) -> str:
    return f"{(Decimal(nanoseconds) / _BILLION).normalize():f}"


def _told_apart(words: Sequence[str]) -> Sequence[str]:
    """Make repeated words differ: a loss that is given twice loses different messages each time."""
    return [each + " again" * words[:place].count(each) for place, each in enumerate(words)]


class Disturbance:
    """Applies the faults of one topic to its messages, in order of receipt."""

    def __init__(self, faults: Sequence[Fault], *, topic: str, seed: int, began: int) -> None:
        """`began` is when the first message of all topics was received, in nanoseconds."""
        self._faults = [each for each in faults if each.kind is not Kind.DROP]
        # Each loss has its own randomness, so that another fault does not change which messages it loses.
        drops = [each for each in faults if each.kind is Kind.DROP]
        self._drops = [
            (each, random.Random(f"{seed} {topic} {words}"))  # noqa: S311  repeatable is the point
            for each, words in zip(drops, _told_apart([_plainly(each) for each in drops]), strict=True)
        ]
        self._topic = topic
        self._of_all = faults
        # The faults that changed something, by their text, whose hash is cached.
        self._at_work: set[str] = set()
        self._began = began
        self._last = began
        # How many messages came, and when the first and the last did, after the begin.
        self._came, self._first, self._latest = 0, 0, 0
        self.most_late: Final = sum(each.amount for each in faults if each.kind is Kind.LATE)
        self.changes_stamps: Final = any(each.kind in (Kind.OFFSET, Kind.DRIFT) for each in faults)

    def received(self, received: int) -> int | None:
        """Return when a message arrives instead, None if it is lost. Messages keep their order."""
        since = received - self._began
        self._first = since if not self._came else self._first
        self._latest = since
        self._came += 1
        # Draw for every loss and message, so that one loss does not change what another loses.
        lost = [
            fault for fault, chance in self._drops if chance.random() * _MILLION < fault.amount and fault.holds(since)
        ]
        lost += [fault for fault in self._faults if fault.kind is Kind.DEAD and fault.holds(since)]
        if lost:
            self._at_work.update(fault.written for fault in lost)
            return None
        late = [fault for fault in self._faults if fault.kind is Kind.LATE and fault.amount and fault.holds(since)]
        for fault in late:
            self._at_work.add(fault.written)
            received += fault.amount
        self._last = max(self._last, received)
        return self._last

    def stamp(self, stamp: int, received: int) -> int:
        """Return a stamp by the wrong clock; an unset stamp of 0 stays 0."""
        if not stamp:
            return stamp
        for fault in self._faults:
            if shift := _shift(fault, received - self._began):
                self._at_work.add(fault.written)
                stamp += shift
        return stamp

    def idle(self) -> Iterator[str]:
        """Yield a sentence for each fault that has not changed a message."""
        for fault in self._of_all:
            if fault.written not in self._at_work:
                yield f"{quoted(fault.written)} changed nothing: {self._why_idle(fault)}"

    def _why_idle(self, fault: Fault) -> str:
        if not self._came:
            return f"no group received a message of {self._topic}"
        if fault.begin > self._latest or (fault.end is not None and fault.end <= self._first):
            first, last = (f"{since / _BILLION:.3f}".rstrip("0").rstrip(".") for since in (self._first, self._latest))
            return f"the first message of {self._topic} came after {first} s, the last after {last} s"
        return f"all {counted(self._came, 'message')} of {self._topic} are as they were"


def _shift(fault: Fault, since: int) -> int:
    """Return the error of a clock at a time in nanoseconds after the begin."""
    if fault.kind is Kind.OFFSET and fault.holds(since):
        return fault.amount
    if fault.kind is Kind.DRIFT and since >= fault.begin:
        # A clock keeps the error that it has accumulated.
        until = since if fault.end is None else min(since, fault.end)
        return (until - fault.begin) * fault.amount // _BILLION
    return 0


def disturbances(faults: Sequence[Fault], topics: Sequence[str], *, seed: int, began: int) -> dict[str, Disturbance]:
    """Return the faults of each topic at work. Raises ValueError for a fault of a topic that is not there."""
    for fault in faults:
        if fault.topic not in topics:
            there = did_you_mean(fault.topic, topics) or f", expected {one_of(dict.fromkeys(topics))}"
            raise ValueError(f"{quoted(fault.written)}: there is no topic {quoted(fault.topic)}{there}")
    of = {topic: [fault for fault in faults if fault.topic == topic] for topic in topics}
    return {topic: Disturbance(each, topic=topic, seed=seed, began=began) for topic, each in of.items() if each}
