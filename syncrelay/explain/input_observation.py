"""What is seen of one input over its last messages: rate, delay, jitter, drift, faults of its stamps."""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from operator import sub
from statistics import median
from typing import Final, TypeAlias

from syncrelay.explain.clocks import Drift, drift
from syncrelay.explain.distribution import Distribution, keep_last, no_values
from syncrelay.explain.epochs import reading, resolution
from syncrelay.explain.figures import InputFigures
from syncrelay.explain.order import WINDOW_NS, StampOrder
from syncrelay.explain.rhythm import AT_ONCE, LEAST_HELD_NS, Burst, PaceWatch, bursts, steady_period
from syncrelay.explain.standing import Pace
from syncrelay.explain.steps import StampSteps
from syncrelay.sync.arrivals import JUMP_NS
from syncrelay.sync.messages import DropReason

Arrivals: TypeAlias = Sequence[tuple[int, int]]
"""Stamps and times of receipt of one input's messages as they came, in nanoseconds."""

_SECOND: Final = 1_000_000_000
_SILENT_NS: Final = 5_000_000_000
_SILENT_PERIODS: Final = 5
_LAST_MESSAGES: Final = 200
# This many messages are kept to try values on.
_TRIED_MESSAGES: Final = 2_000
# A slow input's rate is that of this many messages, however old they are.
_RATE_FROM: Final = 5
# Of the mean period.
_AT_ONCE: Final = 0.1
_DRIFT_POINTS: Final = 300
# Drift costs more than all other figures. From many points it changes slowly: it is measured when so many are new, or
# one of twenty.
_DRIFT_EVERY: Final = 5
_NEW_POINTS: Final = 20
_FEW_POINTS: Final = 12
_NONE: Final[Mapping[DropReason, int]] = {}
_PERIODS: Final = 20
# So many stamps show a pace, if they run as time does but for this share.
_PACED: Final = 41
_AS_TIME: Final = 0.1
# Stamps of another rate have jumped where a delay differs from the one before by so many times as much as usual.
_FAR: Final = 10
# No message is late by so much more or less than the one before it.
_FAR_NS: Final = 10 * _SECOND


class InputObservation:
    """Gathers the messages of one input."""

    def __init__(self) -> None:
        self._stamps = no_values()
        self._received = no_values()
        self._first: int | None = None
        self._flows_since: int | None = None
        self._pace = PaceWatch()
        # So many of the last messages, and no others, are of who publishes now.
        self._paced = 0
        self._nearest = no_values()
        self._delays = no_values()
        self._order = StampOrder()
        self._bursts: deque[Burst] = deque()
        self._newest_arrivals: deque[tuple[int, int]] = deque(maxlen=AT_ONCE)
        self._newest_delays: deque[int] = deque(maxlen=AT_ONCE)
        self._points: deque[tuple[int, int]] = deque(maxlen=_DRIFT_POINTS)
        self._points_seen = 0
        self._drift: Drift | None = None
        self._steps = StampSteps()
        self._delay_before: int | None = None
        self._is_simulated = False
        self._is_misread = False
        self.changed_at = 0
        """When its stamps or its pace were last found to be others than before."""

    def add(self, arrivals: Arrivals, *, by_clock: Callable[[int], int] | None = None) -> bool:
        """Take what came; whether its stamps have fallen back by more than a second.

        `by_clock` tells what time a simulated clock showed at a time of receipt.
        """
        if not arrivals:
            return False
        stamps, received = zip(*arrivals, strict=True)
        last = received[-1]
        was_simulated, self._is_simulated = self._is_simulated, by_clock is not None
        if (self._received and last < self._received[-1]) or was_simulated is not self._is_simulated:
            self._forget()
            self._order.forget()
            self._forget_steps()
        self._follow_flow(received)
        fallen = self._order.add(stamps, received)
        all_received = received
        # A stamp of 0 was never set: it tells nothing of a clock.
        stamped = [arrival for arrival in arrivals if arrival[0]] if 0 in stamps else arrivals
        if stamped and stamped is not arrivals:
            stamps, received = zip(*stamped, strict=True)
        delays = list(map(sub, map(by_clock, received) if by_clock else received, stamps)) if stamped else []
        least, most = (min(delays), max(delays)) if delays else (0, 0)
        if delays:
            self._follow_steps(received, delays, least, most)
        if begin := self._begin_anew(received, delays, least, most, has_fallen=fallen):
            stamped, stamps, delays = [*stamped][begin:], stamps[begin:], delays[begin:]
            least, most = min(delays), max(delays)
        keep_last(self._received, all_received, _LAST_MESSAGES)
        self._paced += len(all_received)
        keep_last(self._stamps, stamps if delays else (), _TRIED_MESSAGES)
        keep_last(self._delays, delays, _TRIED_MESSAGES)
        # What is held up, and then comes at once, was sent at the pace of its stamps.
        # Where it does not run as time does, that is not known.
        self._observe_pace(self._stamps if delays and not self._is_misread else self._received, len(arrivals))
        if delays:
            self._measure(stamped, delays, least, most)
        return fallen

    def _follow_flow(self, received: Sequence[int]) -> None:
        """Look whether it has begun to come, for the first time or after a silence."""
        last = received[-1]
        if self._first is None or last < self._first:
            self._first = self._flows_since = received[0]
        elif self._flows_since is None or last < self._flows_since or self._is_silent_at(received[0]):
            self._flows_since = self.changed_at = received[0]
            self.forget_clock()

    def _follow_steps(self, received: Sequence[int], delays: Sequence[int], least: int, most: int) -> None:
        """Look whether the clock was set. What was stamped before tells nothing of it now."""
        at = self._steps.add(received, delays, least, most, period=lambda: _median_period(self._received))
        if at is not None:
            step, now = self._steps.last, self._steps.least
            if step is not None and step.at == at and now is not None:
                self._delay_before = now + step.by
            old = sum(stamp + delay < at for stamp, delay in zip(self._stamps, self._delays, strict=True))
            del self._stamps[:old], self._delays[:old]
            self._forget_drift(until=at)
            self.changed_at = at

    def _begin_anew(
        self, received: Sequence[int], delays: Sequence[int], least: int, most: int, *, has_fallen: bool
    ) -> int | None:
        """Look whether stamps jumped by what is no delay, and if so forget the clock that they were of.

        Return the first of the new messages that are of the clock of now, if not all are.
        """
        if not delays:
            return None
        before = self._delays[-1] if self._delays else delays[0]
        # Stamps that do not run as time does may have come to do so.
        near = JUMP_NS if has_fallen or self._is_misread else _FAR_NS
        if max(before, most) - min(before, least) <= near:
            # As nearly always, and seen without looking at each.
            return None
        by = _steps([*self._delays[-1:], *delays])
        # Of two clocks in turn, each fall is followed by a rise: nothing begins anew.
        if max(map(abs, by)) <= near or self._steps.swings(received[-1])[0]:
            return None
        # Of seconds that are milliseconds, each is far from the one before it.
        usual = median(map(abs, [*_steps(self._delays[-_PERIODS:]), *by]))
        far = [index for index, each in enumerate(by, len(delays) - len(by)) if abs(each) > max(near, _FAR * usual)]
        if has_fallen:
            self._delay_before = self._steps.least
            self._forget()
        if far or has_fallen:
            self.changed_at = received[far[-1] if far else -1]
            del self._stamps[:], self._delays[:]
            self._forget_drift()
            self._steps.forget_clock()
            if self._is_misread:
                self._steps.forget_levels()
                self._pace.forget()
        return far[-1] if far else None

    def _observe_pace(self, times: Sequence[int], fresh: int) -> None:
        before = self._pace.slowed_from
        self._pace.observe(times, fresh)
        if before != self._pace.slowed_from:
            # The least delay of fewer messages is greater: that is no drift, and no step.
            self._forget_drift()
            self._steps.forget_levels()
            self.changed_at = self._received[-1]

    def forget_publishers(self) -> None:
        """Bear that others publish now than did: their rate and their clocks are not those of before."""
        self._pace.forget()
        self._paced = 0
        self._forget_steps()
        self.forget_clock()

    def forget_clock(self) -> None:
        """Bear that the messages from now on may be stamped by another clock, or come another way."""
        del self._stamps[:], self._delays[:]
        self._forget_drift()
        self._steps.forget_levels()

    def _forget_steps(self) -> None:
        self._steps.forget()
        self._delay_before = None

    def _forget_drift(self, until: int | None = None) -> None:
        # The look in which a clock was set holds stamps of before, too.
        kept = [] if until is None else [point for point in self._points if point[0] > until][1:]
        self._points = deque(kept, _DRIFT_POINTS)
        self._drift = None

    @property
    def slowed_from_hz(self) -> float | None:
        """The steady pace that the input had before it slowed down, None if it has not."""
        return self._pace.slowed_from

    @property
    def pace(self) -> Pace:
        """When the first and the last message came, and how steadily; without a last one where a clock jumped since."""
        last = self._received[-1] if self._received else None
        of_now = self._received[-self._paced :] if self._paced else ()
        return Pace(self._first, last, steady_period(of_now) or self._steady_by_stamps())

    def _steady_by_stamps(self) -> float | None:
        """Return the period of stamps that are steadier than their way here, and run as time does."""
        stamps, delays = self._stamps[-_PACED:], self._delays[-_PACED:]
        if len(stamps) < 2 or abs(delays[-1] - delays[0]) > _AS_TIME * abs(stamps[-1] - stamps[0]):  # noqa: PLR2004
            return None
        return steady_period(sorted(stamps))

    @property
    def period(self) -> float:
        """The median of its last periods, by its stamps; 0 of too few to tell, and of stamps that mostly fall."""
        return max(0.0, _median_period(self._stamps))

    def add_nearest(self, spans: Sequence[int]) -> None:
        """Take the spans of the tightest sets with this input."""
        keep_last(self._nearest, spans, _LAST_MESSAGES)

    def figures(
        self,
        *,
        fed: int,
        dropped: Mapping[DropReason, int],
        last_faults: Mapping[DropReason, int] = _NONE,
        seconds: float,
        now: int,
    ) -> InputFigures:
        """Give the figures; counts are those of the window, which is so many seconds long."""
        fell_by, fell_at = self._order.fell or (None, None)
        # Of what comes no more, nothing will be known soon.
        goes_on = not self._is_silent_at(now)
        rate_hz, usual_hz = self._rates(fed, seconds, now, goes_on=goes_on)
        faulty = self._order.lately(now)
        repeated = [each.at for each in faulty if each.duplicates]
        looks = [each.at for each in faulty if each.duplicates or each.falls]
        swings, swung_by = self._steps.swings(now)
        may_step = self._steps.may_step and goes_on
        bursts = [each for each in self._bursts if each.at > now - WINDOW_NS]
        # Across a step they seem to run at any rate.
        misread = None if may_step else reading(self._stamps, self._delays)
        if self._is_misread is not (misread is not None):
            # The paces were those of stamps.
            self._is_misread = misread is not None
            self._pace.forget()
        return InputFigures(
            rate_hz=rate_hz,
            usual_hz=usual_hz,
            pace_hz=self._pace.now_hz,
            slowed_from_hz=self._pace.slowed_from if rate_hz else None,
            may_be_slower=self._pace.may_be_slower and goes_on,
            fed=fed,
            dropped=dropped,
            last_faults={**last_faults, DropReason.DUPLICATE: max(repeated)} if repeated else last_faults,
            changed_at=self.changed_at,
            flows_since=self._flows_since,
            received=self._received[:],
            stamps=self._stamps[-_LAST_MESSAGES:],
            delays=self._delays[-_LAST_MESSAGES:],
            drift=self._drift,
            reading=misread,
            resolution=resolution(self._stamps, self._delays),
            duplicates=sum(each.duplicates for each in faulty),
            out_of_order=sum(each.out_of_order for each in faulty),
            faulty_looks=len(looks),
            faulty_since=looks[-2] if len(looks) > 1 else None,
            nearest=Distribution(self._nearest[:]),
            bursts=len(bursts),
            held=max((each.held for each in bursts), default=0),
            held_up=[(each.at - each.held, each.at) for each in bursts],
            fell_by=fell_by,
            fell_at=fell_at,
            least_delay=self._steps.least,
            stepped=self._steps.last,
            delay_before=self._delay_before,
            may_step=may_step,
            swings=swings,
            swung_by=swung_by,
        )

    def recent(self) -> Arrivals:
        """Give the last messages that have stamps, more than those of the figures, none from before a clock jumped."""
        return [(stamp, stamp + delay) for stamp, delay in zip(self._stamps, self._delays, strict=True)]

    def _forget(self) -> None:
        """Start afresh: a clock jumped, that of the stamps or this machine's."""
        for kept in (self._stamps, self._delays, self._received, self._nearest):
            del kept[:]
        self._paced = 0
        self._bursts.clear()
        self._newest_arrivals.clear()
        self._newest_delays.clear()
        self._forget_drift()

    def _measure(self, stamped: Arrivals, delays: Sequence[int], least: int, most: int) -> None:
        """Measure drift and bursts, from messages that have stamps."""
        self._find_bursts(stamped, delays, least, most)
        # What came fastest was held up least: the least delay tells more of the clock than of the load.
        self._points.append(((stamped[0][1] + stamped[-1][1]) // 2, least))
        self._points_seen += 1
        every = max(_DRIFT_EVERY, len(self._points) // _NEW_POINTS)
        if len(self._points) < _FEW_POINTS or self._points_seen % every == 0:
            self._drift = drift(self._points)

    def _find_bursts(self, stamped: Arrivals, delays: Sequence[int], least: int, most: int) -> None:
        while self._bursts and self._bursts[0].at <= stamped[-1][1] - WINDOW_NS:
            self._bursts.popleft()
        before = list(self._newest_arrivals)
        held_up = max(most, *self._newest_delays) - min(least, *self._newest_delays) if before else most - least
        self._newest_arrivals.extend(stamped)
        self._newest_delays.extend(delays[-AT_ONCE:])
        if held_up >= LEAST_HELD_NS:
            self._bursts.extend(bursts([*before, *stamped]))

    def is_coming(self, now: int) -> bool:
        """Whether messages came until recently."""
        return bool(self._received) and not self._is_silent_at(now)

    def _is_silent_at(self, now: int) -> bool:
        """Whether the pause since the last message is a silence, by the rate until then."""
        times = self._received
        if not times:
            return False
        pause, usual = now - times[-1], (times[-1] - times[0]) / max(1, len(times) - 1)
        return pause > _SILENT_NS and pause > _SILENT_PERIODS * usual

    def _rates(self, fed: int, seconds: float, now: int, *, goes_on: bool) -> tuple[float, float]:
        """Give messages a second, of the window or of the last few where it held fewer, and while they came."""
        times = self._received
        if len(times) < 2 or times[-1] <= times[0]:  # noqa: PLR2004  two make a period
            return 0.0, 0.0
        # What a latched publisher had kept comes at once, and tells no rate. Some period is as long as the mean one.
        first, last = 0, len(times) - 1
        while (times[first + 1] - times[first]) * last < _AT_ONCE * (times[last] - times[0]):
            first += 1
        mean = (last - first) * _SECOND / (times[last] - times[first])
        usual = mean if len(times) >= _RATE_FROM else 0.0
        if not goes_on:
            return 0.0, usual
        if fed < _RATE_FROM or not seconds:
            return mean, usual
        if self._first is not None and now - self._first < seconds * _SECOND and times[-1] > self._first:
            # It began within the window and has not had all of it.
            return (fed - 1) * _SECOND / (times[-1] - self._first), usual
        return fed / seconds, usual


def _median_period(times: Sequence[int]) -> float:
    """Return the median of the last periods, 0 of too few."""
    periods = _steps(times[-_PERIODS:])
    return median(periods) if periods else 0.0


def _steps(times: Sequence[int]) -> Sequence[int]:
    return list(map(sub, times[1:], times))
