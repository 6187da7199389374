"""Which time stamps are of: their unit, how fast it passes and from when it counts, told by values and slope.

One table of hypotheses is tried on the stamps against the times of receipt. The right one leaves delays that hardly
change; a wrong one leaves a saw-tooth or a slope that no clock has.
"""

from collections import Counter
from collections.abc import Collection, Sequence
from operator import sub
from statistics import median, median_high, median_low
from typing import Final, NamedTuple

from syncrelay.clock import MOST_RATE

_SECOND: Final = 1_000_000_000
BOOT_NS: Final = 365 * 86_400 * _SECOND
"""No machine runs for longer without a boot, nor has its clock been set before 1971."""
# For each time scale: how close stamps must be, how far it is behind UTC, and its name. GPS time began in 1980 and has
# no leap seconds, of which there were 18 since; TAI has 37 more.
_FROM_1980: Final = "GPS time, which counts from 1980"
_GPS_EPOCH: Final = 315_964_800 * _SECOND
_GPS_NEAR: Final = 30 * _SECOND
_TIME_SCALES: Final = (
    (_SECOND // 2, _GPS_EPOCH - 18 * _SECOND, _FROM_1980),
    (_SECOND // 2, -37 * _SECOND, "TAI, the time of PTP clocks, which is 37 s ahead of UTC"),
    (_SECOND // 2, -18 * _SECOND, "GPS time, which is 18 s ahead of UTC"),
)
_ZONE: Final = 1800 * _SECOND
_MOST_ZONES: Final = 28
_FROM_BOOT: Final = "count from boot or the start of a simulation, not from 1970"
# A sensor is as regular as its stamps say if so many of its periods are the same.
_REGULAR: Final = 0.8
# ... but for stamps that leapt while the times of receipt did not: so many, as one may be a clock that was set.
_LEAPS: Final = 2
# The newest messages are read: those of this long, but no fewer than the first number, and of them about the second.
# Two show a unit, as no clock runs 1,000 times too fast; any other rate takes more.
_LATELY: Final = 10 * _SECOND
_FEWEST: Final = 5
_ENOUGH: Final = 40
_SHOW_A_UNIT: Final = 2
# A reading is better than none if delays scatter by at most this share of what they did, and did so by more than this,
# over at least this time: less may be jitter, or a load that grows.
_BETTER: Final = 0.2
_LEAST_SCATTER: Final = 20_000_000
_WATCHED: Final = _SECOND
_EVENLY: Final = 0.3
_NEVER_HELD: Final = 30 * _SECOND
# The delays between these quantiles: a pause or a message that was held up says nothing of a clock.
_MIDDLE: Final = (0.1, 0.9)
_RESOLUTIONS: Final = (_SECOND, _SECOND // 10, _SECOND // 100)
# A slope that is this close to a power of 1,000 is one of a wrong unit.
_CLOSE: Final = 0.05
OTHER_RATE: Final = 1.5 * MOST_RATE
"""What runs off by more than this does not drift: an oscillator may seem to be off by a little more than it is."""


class Reading(NamedTuple):
    """How stamps have to be read: what they do, in words, and how many times as fast as the times of receipt they run.

    `is_unit` says that the unit is wrong, and not the clock: else the words end before the name of the clock that they
    run against. `strayed` is by how much their delays changed.
    """

    what: str
    rate: float = 1.0
    is_unit: bool = False
    strayed: int = 0


class _Unit(NamedTuple):
    rate: float
    what: str


_UNITS: Final = (
    _Unit(1e-3, "are microseconds that were read as nanoseconds"),
    _Unit(1e-6, "are milliseconds that were read as nanoseconds"),
    _Unit(1e3, "hold milliseconds in the field sec"),
    _Unit(1e6, "hold microseconds in the field sec"),
)


class _Part(NamedTuple):
    """A unit of the field nanosec: how many nanoseconds it has, and where the stamps of a second then lie."""

    nanoseconds: int
    what: str


_PARTS: Final = (
    _Part(1_000_000, "lie in the first microsecond of each second: their field nanosec holds milliseconds"),
    _Part(1_000, "lie in the first millisecond of each second: their field nanosec holds microseconds"),
)


class TimeScale(NamedTuple):
    """A time scale: what stamps of it do, and how far they are behind, None where that differs from one to another."""

    what: str
    behind: int | None


def time_scale(newest: int, behind: int) -> TimeScale | None:
    """Recognize the time scale of stamps that are so far behind others; `newest` is the newest of these stamps."""
    if 0 < newest < BOOT_NS and behind > BOOT_NS:
        return TimeScale(_FROM_BOOT, None)
    for close, off, what in _TIME_SCALES:
        if abs(behind - off) < close:
            return TimeScale(f"look like {what}", off)
    if abs(behind - _GPS_EPOCH) < _GPS_NEAR:
        return TimeScale(f"look like {_FROM_1980}", None)
    zones, rest = divmod(abs(behind) + _ZONE // 2, _ZONE)
    if 0 < zones <= _MOST_ZONES and abs(rest - _ZONE // 2) < _SECOND:
        return TimeScale("look like local time, not UTC", round(behind / _ZONE) * _ZONE)
    return None


def usual_delay(delays: Collection[int]) -> int:
    """Return the delay of an input whose stamps are of the usual time: that of most clocks.

    This machine's clock counts as one more, with a delay of 0: where two times are as usual, its own is right.
    """
    clocks = [*delays, 0]
    usual = min(median_low(clocks), median_high(clocks), key=abs)
    return min(delays, key=lambda each: abs(each - usual))


def reading(stamps: Sequence[int], delays: Sequence[int]) -> Reading | None:
    """Return how stamps have to be read, from them and their delays; None where they run as time does.

    All are in nanoseconds, in the order of receipt.
    """
    if len(stamps) < _SHOW_A_UNIT:
        return None
    newest = _newest(stamps, delays)
    some = delays[newest]
    if max(some) - min(some) < _LEAST_SCATTER:
        # As nearly always, and seen without sorting.
        return None
    scatter = _scatter(some)
    # Coarse stamps scatter by as much as they are rounded.
    if scatter < _LEAST_SCATTER or scatter < 2 * _unit(stamps[-_ENOUGH:]):
        return None
    last = [(stamp, stamp + delay) for stamp, delay in zip(stamps[newest], delays[newest], strict=True)]
    found, received = _of_rate(last, scatter), [at for _, at in last]
    span = received[-1] - received[0]
    # Of messages that were held up and come at once, stamps run fast too, but not over as long. Those that a latched
    # publisher kept may, and end at about the time that it is.
    if span < _WATCHED or median(map(sub, received[1:], received)) * len(received) < _EVENLY * span:
        reach = abs(last[-1][0] - last[0][0])
        is_sure = found is not None and found.is_unit and _NEVER_HELD < reach < abs(delays[-1])
        return found if is_sure else None
    return _of_parts(last, scatter) or found


def resolution(stamps: Sequence[int], delays: Sequence[int]) -> int:
    """Return of which unit all the last stamps are multiples, in nanoseconds: 1 s, 100 or 10 ms; 0 of none of these.

    0 too of a sensor that is as regular as that, whose stamps may have been rounded or not, and of one stamp alone.
    `delays` are the times of receipt minus the stamps.
    """
    if not stamps or stamps[-1] % _RESOLUTIONS[-1]:
        # As nearly always: the other units are multiples of this one.
        return 0
    last, unit = stamps[-_ENOUGH:], _unit(stamps[-_ENOUGH:])
    if not unit or len(last) < _FEWEST:
        return 0
    steps = list(map(sub, last[1:], last))
    if steps[0] and _REGULAR * len(last) < steps.count(steps[0]) == len(steps):
        # Nothing leapt.
        return 0
    periods = Counter(steps)
    if periods[0]:
        # No sensor is so regular that it measures twice at a time.
        distinct = set(stamps)
        return _unit(tuple(distinct)) if len(distinct) > 1 else 0
    ((usual, count),) = periods.most_common(1)
    if count <= _REGULAR * len(last):
        return unit
    # Where a message is lost, the next is received as much later as it is stamped. Rounded stamps leap alone.
    late = delays[-len(last) :]
    odd = [
        (step, step + after - before)
        for step, before, after in zip(steps, late, late[1:], strict=False)
        if step != usual
    ]
    leaps = sum(abs(came - usual) < abs(came - step) for step, came in odd)
    return unit if leaps >= _LEAPS and 2 * leaps > len(odd) else 0


def _unit(stamps: Sequence[int]) -> int:
    return next((unit for unit in _RESOLUTIONS if not any(stamp % unit for stamp in stamps)), 0)


def _of_parts(last: Sequence[tuple[int, int]], scatter: int) -> Reading | None:
    """Return a reading by which the field nanosec is of another unit."""
    for part in _PARTS if len(last) >= _FEWEST else ():
        if all(stamp % _SECOND < _SECOND // part.nanoseconds for stamp, _ in last):
            whole = _scatter([received - _spread_out(stamp, part) for stamp, received in last])
            if whole <= _BETTER * scatter:
                return Reading(part.what, is_unit=True, strayed=scatter)
    return None


def _of_rate(last: Sequence[tuple[int, int]], scatter: int) -> Reading | None:
    """Return a reading by which stamps run faster or slower than time."""
    rate, first = _rate(last), last[0][0]
    if rate <= 0 or abs(rate - 1) <= OTHER_RATE:
        return None
    if _scatter([received - round((stamp - first) / rate) for stamp, received in last]) > _BETTER * scatter:
        return None
    for unit in _UNITS:
        if abs(rate / unit.rate - 1) < _CLOSE:
            return Reading(unit.what, unit.rate, is_unit=True, strayed=scatter)
    if len(last) < _FEWEST:
        return None
    runs = f"run at {rate:.4g} times the speed of"
    return Reading(f"{_FROM_BOOT}, and {runs}" if 0 <= last[-1][0] < BOOT_NS else runs, rate, strayed=scatter)


def _newest(stamps: Sequence[int], delays: Sequence[int]) -> slice:
    """Return which of the newest messages are read."""
    count = len(stamps)
    begin = stamps[-1] + delays[-1] - _LATELY
    first = max(0, count - _FEWEST)
    step = max(1, count // _ENOUGH)
    while first > 0 and stamps[first - 1] + delays[first - 1] >= begin:
        first -= step
    first = max(0, first)
    step = max(1, (count - first) // _ENOUGH)
    return slice(first + (count - 1 - first) % step, count, step)


def _scatter(delays: Sequence[int]) -> int:
    ordered = sorted(delays)
    low, high = (ordered[round(share * (len(ordered) - 1))] for share in _MIDDLE)
    return high - low


def _spread_out(stamp: int, part: _Part) -> int:
    return stamp // _SECOND * _SECOND + stamp % _SECOND * part.nanoseconds


def _rate(pairs: Sequence[tuple[int, int]]) -> float:
    """Return how many times as fast as the times of receipt stamps run: the median over pairs half of all apart."""
    half = len(pairs) // 2
    slopes = [
        (after[0] - before[0]) / (after[1] - before[1])
        for before, after in zip(pairs, pairs[half:], strict=False)
        if after[1] > before[1]
    ]
    return median(slopes) if slopes else 0.0
