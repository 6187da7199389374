"""Maps the stamps of a clock of its own to the host's time, from stamps and times of receipt alone.

A message's delay, its time of receipt minus its stamp, is what the clocks are apart, plus the least that the way takes,
plus a jitter. The line under the delays follows the first two, so what is mapped is the host's time of the stamp plus
the least delay, which nothing here can tell: `delay_ns` takes off what is known of it.

What lies far under the line came of a clock that was set forward: that cannot be held up. What stays above it came of
one that was set back, if the messages do not come at once as those do that were held up. Either begins a new epoch,
with the rate of the one before: who sets a clock does not change its oscillator.
"""

from collections import deque
from collections.abc import Callable
from typing import Final, NamedTuple

from syncrelay.clock.envelope import LEAST_JITTER, Envelope

_SECOND: Final = 1_000_000_000
# Stamps that fall by more have jumped, as in the engine.
_JUMP: Final = 1.0
# What is farther under the line than so many times the jitter, and than this, was not just quicker than all before.
_UNDER: Final = 1.5
_LEAST_UNDER: Final = 0.002
_FEW: Final = 5
# While too few messages came to know the jitter, it may be as great as this.
_STEP_OF_ANY: Final = 0.5
# Messages that stay above so many times the jitter, and this, may be of a clock that was set back ...
_ABOVE: Final = 2.0
_LEAST_ABOVE: Final = 0.001
# ... and are if they are unlikely enough as jitter, which is the product of how many and how far, for so long.
_EVIDENCE: Final = 20.0
_FAR: Final = 3.0
_FEWEST: Final = 4.0
_LASTED: Final = 0.5
# Of these that come as spread in time as their stamps are, or one whose stamp came early, the level is taken before.
_LIKELY: Final = 1.5
_LIKELY_ABOVE: Final = 6.0
_KEPT: Final = 400
# The usual period follows a change within so many messages.
_PERIODS: Final = 10
# The jitter is the mean of so many messages. One that is far later than all others is not counted in full.
_REMEMBERED: Final = 200.0
_OUTLIER: Final = 8.0
_LEAST_OUTLIER: Final = 1e-4


class Step(NamedTuple):
    """When stamps stepped, and by how much: positive where they jumped forward."""

    at: int
    by: int


class _Mapped(NamedTuple):
    """The last stamp, its time of receipt, and what it was mapped to."""

    stamp: int
    received: int
    mapped: int


class _Rise:
    """Messages that stay above the line: when they began, how far above the least of them is, and how much they tell.

    A message counts by the share of the time between two stamps that passed between two receipts: one of many that
    were held up and come at once says nothing.
    """

    __slots__ = ("arrivals", "heights", "least", "since", "told")

    def __init__(self, since: int, told: float) -> None:
        self.since, self.told, self.least = since, told, float("inf")
        self.arrivals: deque[tuple[int, int]] = deque(maxlen=_KEPT)
        self.heights: deque[tuple[float, float]] = deque(maxlen=_KEPT)


class DeviceClock:
    """One input's clock. Takes its messages in the order of their receipt; all times are in nanoseconds."""

    __slots__ = (
        "_before",
        "_behind",
        "_count",
        "_delay",
        "_device_0",
        "_jitter",
        "_jitter_of",
        "_line",
        "_newest",
        "_period",
        "_rise",
        "_stepped",
    )

    def __init__(self, *, delay_ns: int = 0, stepped: Callable[[Step], None] | None = None) -> None:
        """Take off a known least delay from all that is mapped; `stepped` hears of each epoch that begins."""
        self._delay = delay_ns
        self._stepped = stepped
        self._line = Envelope()
        self._device_0 = self._behind = 0
        self._count = 0
        self._newest = 0.0
        self._jitter = self._jitter_of = 0.0
        self._period: float | None = None
        self._rise: _Rise | None = None
        self._before: _Mapped | None = None

    @property
    def rate(self) -> float:
        """How much the delays grow a second, without unit: positive where the device's clock runs slow."""
        return self._line.rate

    def host_time(self, stamp: int, received: int) -> int:
        """Return the host's time of a stamp that was received now. A stamp of 0 was never set, and stays."""
        if not stamp:
            return 0
        before = self._before
        if before is None:
            self._begin(stamp, received)
            self._take(0.0, 0.0)
            return self._mapped(stamp, received, 0.0)
        x, y = self._point(stamp, received)
        height, period = self._line.height(x, y), (stamp - before.stamp) / _SECOND
        told = min(1.0, max(0.0, (received - before.received) / _SECOND / period)) if period > 0 else 1.0
        if x < self._newest - _JUMP or height < -self._least_step():
            # Of stamps that jumped far, the line tells nothing: as late as the newest would be, this one is.
            self._step(stamp, received, self._line.height(self._newest, y))
            x = y = height = 0.0
        elif height >= _ABOVE * self._jitter + _LEAST_ABOVE and self._count > _FEW:
            self._rises(stamp, received, height, told, period)
            if self._rise is None:
                x, y = self._point(stamp, received)
                height = self._line.height(x, y)
        elif self._rise is not None:
            # They were late, and no clock was set: that is jitter.
            for each in self._rise.heights:
                self._learn(*each)
            self._rise = None
        if self._rise is None:
            self._learn(max(0.0, height), told)
        self._take(x, y)
        self._count_on(period)
        return self._mapped(stamp, received, x)

    def _point(self, stamp: int, received: int) -> tuple[float, float]:
        """Return a message's time by its clock and its delay, both since the epoch began, in seconds."""
        return (stamp - self._device_0) / _SECOND, (received - stamp - self._behind) / _SECOND

    def _count_on(self, period: float) -> None:
        """Learn how far apart stamps usually are."""
        if period > 0:
            usual = self._period or period
            self._period = usual + (min(max(period, usual / 2), 2 * usual) - usual) / _PERIODS

    def _mapped(self, stamp: int, received: int, x: float) -> int:
        line, rise, before = self._line, self._rise, self._before
        level = line.level
        if rise is not None and rise.told >= _LIKELY and rise.least > _LIKELY_ABOVE * self._jitter:
            level += rise.least
        # Nothing is received before its time.
        mapped = min(stamp + self._behind + int((level + line.rate * x) * _SECOND), received)
        if before is not None:
            if stamp == before.stamp:
                mapped = before.mapped
            elif stamp > before.stamp and mapped <= before.mapped <= received:
                # The line falls as it gets to know quicker messages; time does not, unless this machine's was set back.
                mapped = before.mapped + 1
        self._before = _Mapped(stamp, received, mapped)
        return mapped - self._delay

    def _begin(self, stamp: int, received: int) -> None:
        self._line = self._line.anew()
        self._device_0, self._behind = stamp, received - stamp
        self._newest, self._count = 0.0, 0
        self._rise = None

    def _step(self, stamp: int, received: int, height: float) -> None:
        if self._stepped is not None:
            self._stepped(Step(received, -round(height * _SECOND)))
        self._begin(stamp, received)

    def _least_step(self) -> float:
        if self._jitter_of < _FEW:
            return _STEP_OF_ANY
        return _UNDER * self._jitter / min(1.0, self._count / _FEW) + _LEAST_UNDER

    def _take(self, x: float, y: float) -> None:
        self._count += 1
        self._line.add(x, y, self._jitter)
        self._newest = max(self._newest, x)

    def _learn(self, height: float, weight: float) -> None:
        self._jitter_of = min(self._jitter_of + weight, _REMEMBERED)
        if self._jitter_of > _FEW:
            height = min(height, _OUTLIER * self._jitter + _LEAST_OUTLIER)
        if weight:
            self._jitter += weight / self._jitter_of * (height - self._jitter)

    def _rises(self, stamp: int, received: int, height: float, told: float, period: float) -> None:
        """Take a message that lies above the line; if they stay there, begin a new epoch with the first of them."""
        rise = self._rise
        # A stamp that is early by as much as the message is late: it was not held up, its clock was set back.
        if self._period is not None and self._period - period >= height / 2:
            rise = self._rise = _Rise(received, _LIKELY)
        elif rise is None:
            rise = self._rise = _Rise(received, 0.0)
        else:
            rise.told += told
        rise.least = min(rise.least, height)
        rise.arrivals.append((stamp, received))
        rise.heights.append((height, told))
        far = min(rise.least / max(self._jitter, LEAST_JITTER), _FAR)
        if received - rise.since < _LASTED * _SECOND or rise.told < _FEWEST or rise.told * far < _EVIDENCE:
            return
        *earlier, _ = rise.arrivals
        self._step(*earlier[0], rise.least)
        for each in earlier:
            self._take(*self._point(*each))
