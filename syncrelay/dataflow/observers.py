"""What the relay observes of itself: standstills, waits, losses, and clocks that step or stop. Times in nanoseconds."""

from collections import deque
from collections.abc import Hashable, Sequence
from typing import Final, NamedTuple

from syncrelay.dataflow.deliveries import MOST_PUBLISHERS, Deliveries
from syncrelay.explain import STEP_NS, ClockState, Endpoint, Sender, Standstill, Step
from syncrelay.runtime import SYSTEM, Runtime

# What was lost, and what had to wait, is reported for the last ten evaluations.
_RECENT: Final = 10
# So many evaluations after a publisher was found, its first messages have arrived: it may find the subscription only
# with the next announcement, 3 s later, and what its history has dropped by then counts as lost.
_SETTLING: Final = 5
# Fast DDS announces a node every 3 s, and what it publishes is known some tenths of a second later.
_UNCHANGED_S: Final = 4.0
# A graph in which nodes come and go all the time never rests: three announcements are enough.
_DISCOVERED_AT_LATEST_S: Final = 10.0
# A clock that is set moves at once; one that is slewed only runs faster or slower.
_STEP_NS: Final = 100_000_000
_READINGS: Final = 3
_SECOND: Final = 1_000_000_000
# The rate at which a publisher sends is that between so many evaluations, 3 s: a change shows soon.
_POINTS: Final = 4
_TOLD_NS: Final = 30_000_000_000
# A /clock at 1 Hz stands still for a second between two ticks.
_CLOCK_STOPPED_NS: Final = 2_500_000_000


class Standstills:
    """How long the process did not run, as seen by a thread that works in short steps and rests between them."""

    def __init__(self, *, runtime: Runtime = SYSTEM) -> None:
        self._runtime = runtime
        self._recent: deque[Standstill | None] = deque(maxlen=_RECENT)
        self._longest_now: Standstill | None = None
        self._began = self._runtime.monotonic_ns()

    def begin(self) -> None:
        """Begin a step now."""
        self._began = self._runtime.monotonic_ns()

    def end(self, *, rest: int = 0) -> None:
        """Note how long a step took, without the rest that it took on purpose; the next one begins now."""
        before = self._began
        self.begin()
        self.note(Standstill(self._runtime.time_ns(), self._began - before - rest, rest))

    def note(self, standstill: Standstill) -> None:
        """Take a standstill that ends now."""
        if self._longest_now is None or standstill.ns > self._longest_now.ns:
            self._longest_now = standstill

    def observe(self) -> None:
        """Begin the next evaluation."""
        self._recent.append(self._longest_now)
        self._longest_now = None

    @property
    def recent(self) -> tuple[Standstill, ...]:
        """The longest of each of the last evaluations."""
        return tuple(filter(None, self._recent))


class Waits:
    """How long messages of a topic waited for the relay."""

    def __init__(self) -> None:
        self._recent: deque[int] = deque(maxlen=_RECENT)

    def observe(self, waited: int) -> None:
        """Take the longest wait since the last evaluation."""
        self._recent.append(waited)

    @property
    def longest(self) -> int:
        """The longest of the last evaluations."""
        return max(self._recent, default=0)


class Losses:
    """How many messages of a topic DDS lost. What a new publisher sent before it was found is no loss.

    DDS may count that before the graph shows the publisher, so losses are taken at the next evaluation.
    """

    def __init__(self) -> None:
        self._totals: deque[int] = deque(maxlen=_RECENT)
        self._newest = 0
        self.total = 0
        """How many were lost since the relay started."""
        self._links: frozenset[Hashable] = frozenset()
        self._settling = 0

    def observe(self, total: int, *, links: frozenset[Hashable]) -> None:
        """Take the total lost since the subscription was made; `links` are it with each publisher that there is."""
        is_anew = total < self._newest
        is_new = bool(links - self._links)
        if self._totals and (is_anew or not is_new):
            self.total += self._newest - self._totals[-1]
        if is_anew or is_new:
            self._settling = _SETTLING
        if self._settling:
            self._settling -= 1
            self._totals.clear()
        else:
            self._totals.append(self._newest)
        self._links, self._newest = links, total

    @property
    def recent(self) -> int:
        """How many were lost in the last evaluations."""
        return self._totals[-1] - self._totals[0] if self._totals else 0


class _Came(NamedTuple):
    """What came of a publisher since the evaluation before."""

    sent: int
    delivered: int
    longest_gap: int = 0
    way: int | None = None


_NOTHING: Final = _Came(0, 0)


class _Publisher:
    """One publisher, evaluation by evaluation."""

    def __init__(self) -> None:
        self.node = "a publisher that left"
        self.sent = self.delivered = 0
        self._last: Deliveries | None = None
        self._lately: deque[_Came] = deque(maxlen=_RECENT)
        self._points: deque[tuple[int, int]] = deque(maxlen=_POINTS)

    def observe(self, now: Deliveries | None) -> None:
        """Take its counts, None where there are none."""
        before, self._last = self._last, now
        came = _NOTHING
        if now is not None:
            # One that is counted anew restarted, or the subscription was made anew.
            if before is not None and (before.first != now.first or before.newest > now.newest):
                before = None
            if before is None:
                self._points.clear()
            # Without a gid its numbers may be those of several, until the next evaluation has seen that they rise.
            if before is not None or now.gid is not None:
                sent, delivered = (before.sent, before.delivered) if before is not None else (0, 0)
                came = _Came(now.sent - sent, now.delivered - delivered, now.longest_gap, now.least_way)
            if not self._points or self._points[-1][0] != now.newest:
                self._points.append((now.newest, now.published))
        self._lately.append(came)
        self.sent += came.sent
        self.delivered += came.delivered

    @property
    def is_recent(self) -> bool:
        """Whether it is counted now, or was within the last evaluations."""
        return self._last is not None or any(each.sent for each in self._lately)

    @property
    def _rate(self) -> float | None:
        if len(self._points) < 2:  # noqa: PLR2004  two make a period
            return None
        (first, began), (last, ended) = self._points[0], self._points[-1]
        # Whoever publishes may give any times.
        return min((last - first) * _SECOND / (ended - began), _SECOND) if ended > began else None

    def sender(self) -> Sender:
        """Give it as a value."""
        sent, delivered, gaps, ways = zip(*self._lately, strict=True)
        return Sender(
            self.node,
            sent=sum(sent),
            delivered=sum(delivered),
            longest_gap=max(gaps),
            sent_hz=self._rate,
            way=min((each for each in ways if each is not None), default=None),
            sent_in_all=self.sent,
            delivered_in_all=self.delivered,
        )


class Senders:
    """The nodes that publish a topic: how many messages each sent, and how many of them came.

    Where messages do not say whose they are, they are counted while the graph shows one publisher alone.
    """

    def __init__(self) -> None:
        self._publishers: dict[bytes, _Publisher] = {}
        self._gone: dict[str, tuple[int, int]] = {}
        self._recent: tuple[Sender, ...] | None = None

    def observe(self, deliveries: Sequence[Deliveries], publishers: Sequence[Endpoint]) -> None:
        """Take what came of each publisher, and what the graph shows of them."""
        self._recent = None
        alone = publishers[0].gid if len(publishers) == 1 else b""
        came = {alone if each.gid is None else each.gid: each for each in deliveries}
        came.pop(b"", None)
        for gid in [*came, *(each for each in self._publishers if each not in came)]:
            if gid not in self._publishers:
                self._publishers[gid] = _Publisher()
            self._publishers[gid].observe(came.get(gid))
        for each in publishers:
            if each.gid in self._publishers:
                self._publishers[each.gid].node = each.node
        for gid in [gid for gid, each in self._publishers.items() if not each.is_recent]:
            self._forget(self._publishers.pop(gid))

    def _forget(self, gone: _Publisher) -> None:
        """Keep the totals of its node, as long as there are few."""
        sent, delivered = self._gone.pop(gone.node, (0, 0))
        self._gone[gone.node] = sent + gone.sent, delivered + gone.delivered
        if len(self._gone) > MOST_PUBLISHERS:
            del self._gone[next(iter(self._gone))]

    @property
    def recent(self) -> tuple[Sender, ...]:
        """What is known of each node; several publishers of one node, as after its restart, are one."""
        if self._recent is None:
            # The same for all groups that use the topic.
            self._recent = self._by_node()
        return self._recent

    def _by_node(self) -> tuple[Sender, ...]:
        found = {
            node: Sender(node, 0, 0, sent_in_all=sent, delivered_in_all=came)
            for node, (sent, came) in self._gone.items()
        }
        for each in self._publishers.values():
            sender = each.sender()
            before = found.get(sender.node)
            found[sender.node] = sender if before is None else _together(before, sender)
        return tuple(found.values())


def _together(one: Sender, other: Sender) -> Sender:
    rates = [each.sent_hz for each in (one, other) if each.sent and each.sent_hz is not None]
    return Sender(
        one.node,
        sent=one.sent + other.sent,
        delivered=one.delivered + other.delivered,
        longest_gap=max(one.longest_gap, other.longest_gap),
        sent_hz=sum(rates) if rates else None,
        way=min((each.way for each in (one, other) if each.way is not None), default=None),
        sent_in_all=one.sent_in_all + other.sent_in_all,
        delivered_in_all=one.delivered_in_all + other.delivered_in_all,
    )


class Discovery:
    """Whether nodes that run may still be missing from the graph, because this one has just joined it.

    Fast DDS finds most at once. A node that missed the first announcements is found at the next, which come every 3 s.
    So discovery is over once the graph has stayed as it is for longer than that.
    """

    def __init__(self, *, now: float) -> None:
        """Take the monotonic time in seconds, here as below."""
        self._latest = now + _DISCOVERED_AT_LATEST_S
        self._ends = now + _UNCHANGED_S
        self._graph: Hashable = None

    def observe(self, graph: Hashable, *, now: float) -> None:
        """Take what the graph holds, to see whether it has changed."""
        if self._graph not in (None, graph) and self.goes_on(now):
            self._ends = min(now + _UNCHANGED_S, self._latest)
        self._graph = graph

    def goes_on(self, now: float) -> bool:
        """Whether nodes may still be found that were there before."""
        return now < self._ends


class SystemClock:
    """Whether the system's clock was set."""

    def __init__(self, *, runtime: Runtime = SYSTEM) -> None:
        self._runtime = runtime
        self._offset = _offset(runtime)
        self._step: Step | None = None

    def has_stepped(self, now: int) -> bool:
        """Whether it was set since this was last asked."""
        before, self._offset = self._offset, _offset(self._runtime)
        by = self._offset - before
        if abs(by) >= STEP_NS:
            self._step = Step(now, by)
        return abs(by) > _STEP_NS

    def last_step(self, now: int) -> Step | None:
        """Return when it was last set and by how much, if that was half a second or more, in the last half minute."""
        return self._step if self._step and 0 <= now - self._step.at < _TOLD_NS else None


def _offset(runtime: Runtime) -> int:
    """How far the system's clock is ahead of the monotonic one."""
    # The quickest of a few readings: a thread that was interrupted between the two clocks would see a step.
    return min(_reading(runtime) for _ in range(_READINGS))[1]


def _reading(runtime: Runtime) -> tuple[int, int]:
    before = runtime.monotonic_ns()
    system = runtime.time_ns()
    after = runtime.monotonic_ns()
    return after - before, system - (before + after) // 2


class SimulatedClock:
    """Whether simulated time moves, and what it was when messages were received."""

    def __init__(self, *, runtime: Runtime = SYSTEM) -> None:
        self._moved_at = runtime.time_ns()
        self._now = (self._moved_at, 0)
        self._rate = 1.0
        self.is_steady = False
        """Whether it ran on since the last evaluation: only then is it known what it was in between."""
        self.state = ClockState(received=False)

    def observe(self, simulated: int, *, now: int) -> None:
        """Take the simulated time of now, 0 before the first."""
        before_at, before = self._now
        self.is_steady = 0 < before <= simulated and before_at < now
        self._rate = (simulated - before) / (now - before_at) if self.is_steady else 1.0
        if simulated != before:
            self._moved_at = now
        self._now = (now, simulated)
        still = now - self._moved_at
        self.state = ClockState(simulated != 0, still if still >= _CLOCK_STOPPED_NS else None)

    def at(self, received: int) -> int:
        """Return the simulated time at which a message was received since the last evaluation but one."""
        now, simulated = self._now
        return simulated - round((now - received) * self._rate)
