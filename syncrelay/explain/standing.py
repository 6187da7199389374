"""A group's standing: the share of its possible sets that left, with hysteresis against chance."""

from collections import deque
from collections.abc import Callable, Sequence
from enum import Enum
from typing import Final, NamedTuple, TypeAlias

from syncrelay.explain.rhythm import chance
from syncrelay.sync.counts import InputCounts
from syncrelay.sync.messages import DropReason

_SECOND: Final = 1_000_000_000
SHARE_WINDOW_NS: Final = 10 * _SECOND
"""The share covers about this time, or more if fewer than 30 sets were possible in it."""
_LONGEST: Final = 600 * _SECOND
# With fewer possible sets than this there is no share. A window that holds the second number is long enough.
_FEWEST: Final = 10
# At 100 Hz ten sets are a tenth of a second, in which inputs that begin one after the other miss some.
_LEAST_NS: Final = 2_500_000_000
_ENOUGH_TO_TELL: Final = 30
# Below this share a group gives too few sets, until the share is above the other bound.
FEW: Final = 0.8
BACK: Final = 0.95
"""The share at which few sets are enough again."""
# A silence ends at this share: a single stray set in 5 s is at most a third of the possible ones.
_AGAIN: Final = 0.5
# Of few possible sets, as many are missing by chance, of a group that gives enough, in less than this share of cases.
_BY_CHANCE: Final = 0.005
# The pace of a steady input is measured this precisely: a smaller share of missing messages is not counted.
_UNSURE: Final = 0.05
# An input pauses if nothing came for more than a second and for more periods than this.
_PAUSE: Final = 5
# This many periods after the last message of any input, nothing more is expected.
_LATE: Final = 2
NO_SET_MISSED: Final = frozenset(
    {
        DropReason.THINNED,
        DropReason.DUPLICATE,
        DropReason.PAUSED,
        DropReason.SHUTDOWN,
        DropReason.TIME_JUMP,
    }
)
"""Drop reasons that cost no possible set: dropped on purpose, or replaced by a message of the same stamp."""


class Standing(Enum):
    """How many of the possible sets leave: enough, few, or none since the silence began."""

    ENOUGH = "enough"
    FEW = "few"
    NONE = "none"


class Share(NamedTuple):
    """The sets that left, and those that were possible, in the last `ns` nanoseconds.

    The needed input with the fewest messages, received or expected, limits what is `possible`. It is the `pacemaker`;
    None if a clock makes the sets. `absent` counts its messages that should have come, at its usual pace, and did not.
    `is_pausing` is set while those of any input still do not come. A needed input without a steady pace is `unsteady`:
    nothing shows what it lost, so more sets may have been possible.
    """

    left: int = 0
    possible: int = 0
    ns: int = 0
    pacemaker: int | None = None
    absent: int = 0
    is_pausing: bool = False
    unsteady: int | None = None

    @property
    def value(self) -> float | None:
        """From 0 to 1; None while fewer than 10 sets were possible, or not for long enough."""
        is_known = self.possible >= _FEWEST and self.ns >= _LEAST_NS
        return min(1.0, self.left / self.possible) if is_known else None


NOT_KNOWN: Final = Share()

Shares: TypeAlias = Callable[[int], Share]
"""The share since a time within the window."""


class Pace(NamedTuple):
    """When the first and the last message of an input were received (None if none was), and its period.

    `period` is None for an input without a steady rate.
    """

    first: int | None
    last: int | None
    period: float | None


class _Poll(NamedTuple):
    """The counts at one poll, in total since the start: of sets, and of the messages of each counted input.

    `clock` is the time of the clock that makes the sets. `owed` counts the messages that should have come at a steady
    pace, `taken` those that left or are still buffered.
    """

    at: int
    clock: int
    sets: int
    fed: tuple[int, ...]
    owed: tuple[float, ...]
    taken: tuple[int, ...]
    gone: tuple[int, ...]
    thinned: tuple[int, ...]


class ShareWindow:
    """Measures the share, poll by poll, over the last seconds.

    `enough` returns the inputs that a set needs, those with the greatest numbers where there is a choice. No set is
    possible before they have come, and they limit the number of sets, or the `trigger` alone. `ticks_hz` is the rate of
    the clock that makes the sets, or None. `every` and `least_period` say how sets are thinned.
    """

    def __init__(
        self,
        enough: Callable[[Sequence[float]], Sequence[int]],
        *,
        trigger: int | None,
        ticks_hz: float | None,
        every: int = 1,
        least_period: int | None = None,
    ) -> None:
        self._enough = enough
        self._trigger = trigger
        self._ticks_hz = ticks_hz
        self._every = every
        self._least_period = least_period
        self._polls: deque[_Poll] = deque()
        self._is_pausing: list[bool] = []
        self._is_steady: list[bool] = []
        self._paced: set[int] = set()
        # None until all have come.
        self._had_clock: bool | None = None
        self._share: Share | None = None

    def clear(self) -> None:
        """Start afresh: a clock was set, or nothing was fed for a while."""
        self._polls.clear()
        self._paced.clear()
        self._share = None

    def add(
        self, counts: Sequence[InputCounts], sets: int, paces: Sequence[Pace], *, now: int, clock: int | None = None
    ) -> None:
        """Take the counts as they are now; `clock` is the time by which sets are made, where it is not `now`."""
        had_clock, has_clock = self._had_clock, clock is not None
        self._had_clock = has_clock if self._have_come(paces) else None
        if had_clock is not has_clock:
            # Nothing is known to lie between the times of two clocks. What came before the last input did makes no set.
            self._polls.clear()
        elif self._ticks_hz is not None and self._polls and not self._polls[-1].sets:
            # Nothing counts the ticks before the first set, so the window begins with that set.
            self._polls.clear()
        inputs = counts
        thinned = tuple([each.dropped.get(DropReason.THINNED, 0) for each in inputs])
        missed = [sum(n for why, n in each.dropped.items() if why not in NO_SET_MISSED) for each in inputs]
        gone = tuple([each.matched + n for each, n in zip(inputs, missed, strict=True)])
        taken = tuple([n + each.buffered for each, n in zip(inputs, gone, strict=True)])
        fed = tuple([each.fed for each in inputs])
        owed = self._owed(fed, paces, now)
        self._is_pausing = [_is_pausing(pace, now) for pace in paces]
        self._is_steady = [pace.period is not None for pace in paces]
        self._polls.append(_Poll(now, now if clock is None else clock, sets, fed, owed, taken, gone, thinned))
        self._share = None
        while len(self._polls) > 1 and (ns := now - self._polls[1].at) >= SHARE_WINDOW_NS:
            shorter = self._since(self._polls[1]) if ns <= _LONGEST else None
            if shorter is not None and shorter.possible < _ENOUGH_TO_TELL:
                break
            self._polls.popleft()
            self._share = shorter

    def share(self) -> Share:
        """Return the share of the window."""
        if self._share is None:
            self._share = self._since(self._polls[0]) if self._polls else NOT_KNOWN
        return self._share

    def _have_come(self, paces: Sequence[Pace]) -> bool:
        have = [pace.first is not None for pace in paces]
        return all(have[index] for index in self._enough(have))

    def shares(self) -> Shares:
        """Return the shares of all that the window can be divided into, as it is now."""
        polls = tuple(self._polls)

        def since(at: int) -> Share:
            first = next((each for each in polls if each.at >= at), None)
            return NOT_KNOWN if first is None else self._between(first, polls[-1])

        return since

    def _owed(self, fed: tuple[int, ...], paces: Sequence[Pace], now: int) -> tuple[float, ...]:
        """Return how many messages each input should have sent by now; while all are away, nothing is owed."""
        if not self._polls:
            return fed
        for index, pace in enumerate(paces):
            if index not in self._paced and pace.period is not None:
                self._paced.add(index)
                self._count_again(index, pace.period, since=pace.first)
        before = self._polls[-1]
        last = max((each.last for each in paces if each.last is not None), default=before.at)
        owed = []
        for pace, came, owed_before, fed_before in zip(paces, fed, before.owed, before.fed, strict=True):
            if pace.period is None:
                owed.append(owed_before + came - fed_before)
            else:
                begin = max(before.at, pace.first or before.at)
                owed.append(owed_before + max(0, min(now, round(last + _LATE * pace.period)) - begin) / pace.period)
        return tuple(owed)

    def _count_again(self, place: int, period: float, *, since: int | None) -> None:
        """Count what an input owed since the first poll, or its first message, now that its period is known."""
        first = self._polls[0]
        begin = max(first.at, since or first.at)
        for number, poll in enumerate(self._polls):
            owed = first.owed[place] + max(0, poll.at - begin) / period
            self._polls[number] = poll._replace(owed=(*poll.owed[:place], owed, *poll.owed[place + 1 :]))

    def _since(self, first: _Poll) -> Share:
        return self._between(first, self._polls[-1])

    def _between(self, first: _Poll, last: _Poll) -> Share:
        left, ns = last.sets - first.sets, last.at - first.at
        if self._ticks_hz is not None:
            elapsed = last.clock - first.clock
            return Share(left, self._thinned(int(elapsed * self._ticks_hz / _SECOND / self._every), elapsed), ns)
        of_all = [(*self._due(index, first, last), index) for index in range(len(last.fed))]
        # Who is away allows no sets, but is not needed while enough others come.
        needed = self._enough([allowed - absent for allowed, absent, _ in of_all])
        due = [of_all[index] for index in (needed if self._trigger is None else [self._trigger])]
        possible = min(due)[0]
        # Of those that limit it about alike, the one whose messages are absent is why. Those of others wait for it.
        waiting = min(absent + last.taken[index] - first.taken[index] for _, absent, index in due)
        alike = (each for each in due if each[0] <= 1 + (1 + _UNSURE) * max(possible, waiting))
        _, absent, pacemaker = max(alike, key=lambda each: (each[1], -each[0]))
        is_pausing = any(self._is_pausing[index] for _, _, index in due)
        unsteady = next((index for _, _, index in due if not self._is_steady[index]), None)
        return Share(left, self._thinned(possible, ns), ns, pacemaker, absent, is_pausing, unsteady)

    def _thinned(self, possible: int, ns: int) -> int:
        return min(possible, ns // self._least_period) if self._least_period else possible

    @staticmethod
    def _due(place: int, first: _Poll, last: _Poll) -> tuple[int, int]:
        """Return how many sets an input allows, and how many of its messages are absent."""
        # Messages that were buffered before the first poll count for the time before it.
        gone = max(0, min(last.gone[place] - first.gone[place], last.taken[place] - first.taken[place]))
        thinned = last.thinned[place] - first.thinned[place]
        owed = int(last.owed[place] - first.owed[place])
        absent = owed - (last.fed[place] - first.fed[place])
        if absent <= 1 + _UNSURE * owed:
            return gone, 0
        if thinned:
            absent = absent * gone // (gone + thinned)
        return gone + absent, absent


def _is_pausing(pace: Pace, now: int) -> bool:
    if pace.last is None or pace.period is None:
        return False
    return now - pace.last > max(_SECOND, _PAUSE * pace.period)


class StandingWatch:
    """Follows how a group stands, from moment to moment."""

    def __init__(self) -> None:
        self.now = Standing.ENOUGH

    def follow(self, share: Share, *, is_silent: bool) -> Standing:
        """Return how it stands now; `is_silent` says that no set leaves, though it should have been long ago."""
        value = share.value
        if is_silent:
            self.now = Standing.NONE
        elif value is not None and not (share.is_pausing and self.now is Standing.ENOUGH):
            # A silence says nothing of what leaves after it: of a slow group, two sets that are missing are one.
            if value >= BACK or (self.now is not Standing.FEW and not _are_few(share)):
                self.now = Standing.ENOUGH
            elif self.now is Standing.ENOUGH or value >= _AGAIN:
                self.now = Standing.FEW
        return self.now


def _are_few(share: Share) -> bool:
    """Whether so few sets left that it is no chance: of those that are enough again, so many may be missing."""
    if share.left >= FEW * share.possible:
        return False
    missing = share.possible - share.left
    return share.possible >= _ENOUGH_TO_TELL or chance(missing, share.possible, 1 - BACK) < _BY_CHANCE
