"""Kinds of faults: each changes a drawn rig, and returns what is then true and from when it can be seen.

A new kind is a function here. It returns None where the rig is one in which the fault does no harm, or cannot be seen.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

import numpy as np

from syncrelay.config.profile import Mismatch
from tests.bank.rig import LONGEST_S, Flow, Rig, S, spans
from tests.explain.scenario import MS


@dataclass(frozen=True, slots=True)
class Truth:
    """What a first sentence must say: a code of these, about one of these topics, one of the sizes, one of the words.

    Sizes are of the unit `ns`, `ppm`, `Hz`, `times` or `count`. `seen` is the second from which it can be seen.
    `moments` says that an offered value must give the sets of one moment.
    """

    codes: frozenset[str]
    topics: frozenset[str]
    seen: float
    sizes: tuple[float, ...] = ()
    unit: str = "ns"
    says: tuple[str, ...] = ()
    moments: bool = False


Draw: TypeAlias = Callable[[Rig], Truth | None]


@dataclass(frozen=True, slots=True)
class Kind:
    draw: Draw
    policies: tuple[str, ...]
    same_rate: bool
    midway: float
    """The share of draws in which it begins while the relay runs."""


KINDS: Final[dict[str, Kind]] = {}
_BY_SLOP: Final = ("approximate_time", "approximate_time", "approximate_time_eager")
# A share of sets that is missed in any look, and a share of a unit within which what is cut off stays the same.
_MANY: Final = 0.25
_STANDS: Final = 0.25
_ANY: Final = (*_BY_SLOP, "exact_time", "latest_time")


def _kind(
    *, policies: tuple[str, ...] = _BY_SLOP, same_rate: bool = False, midway: float = 0.0
) -> Callable[[Draw], Draw]:
    def add(draw: Draw) -> Draw:
        KINDS[draw.__name__] = Kind(draw, policies, same_rate, midway)
        return draw

    return add


def _truth(codes: str, flow: Flow | None, seen: float, sizes: tuple[float, ...] = (), **more: object) -> Truth:
    topics = frozenset() if flow is None else frozenset({flow.topic})
    return Truth(frozenset(codes.split()), topics, seen, sizes, **more)  # type: ignore[arg-type]


def _sign(rig: Rig) -> int:
    return rig.chance.choice([-1, 1])


def _log(rig: Rig, low: float, high: float) -> float:
    return low * (high / low) ** rig.chance.random()


def _one(rig: Rig) -> Flow:
    return rig.chance.choice(rig.flows)


def _lost(rig: Rig) -> float:
    """The share of the slowest input's messages whose nearest set is too wide."""
    slowest = max(rig.flows, key=lambda each: each.period)
    after = spans(rig)
    return float(np.mean(after > rig.slop)) if len(after) else 0.0 * slowest.hz


def _shift(rig: Rig, flow: Flow, by: int, codes: str) -> Truth | None:
    """Put the stamps of a flow off, where that costs sets or pairs messages of two moments."""
    before = flow.stamps.copy()
    pivot = max((each for each in rig.flows if each is not flow), key=lambda each: each.period)
    flow.stamps = flow.stamps + by
    lost, period = _lost(rig), max(each.period for each in rig.flows)
    is_same = all(abs(each.period / period - 1) < 0.01 for each in rig.flows)
    is_whole = is_same and abs(by) > 0.7 * period and max(each.jitter for each in rig.flows) < 0.05 * period
    # Stamps that are whole periods off fit those of others, and may be right: results may take that long. Of inputs
    # that are not measured at the same time, nobody can say which belong together.
    distances = spans(rig, [flow, pivot])
    if not len(distances) or not len(spans(rig)):
        return None
    fits = np.median(distances) < 0.15 * period
    delay = float(np.median(flow.received - (flow.stamps - rig.began)))
    n = min(len(pivot.true), len(flow.true), 50)
    phase = int(np.median(flow.true[:n] - pivot.true[:n])) if is_same else 0
    if (lost < 0.95 and not (is_whole and lost < 0.05)) or (is_whole and (fits or abs(phase) > 0.08 * period)):
        flow.stamps = before
        return None
    late = max(each.lateness for each in rig.flows) - min(each.lateness for each in rig.flows)
    # Where sets leave, and no stamp is ahead of its time, only that messages come at the same part of their periods
    # shows which belong together: else the one may as well take that long, or be of another moment.
    if is_whole and delay > -0.25 * period and late > 0.08 * period:
        flow.stamps = before
        return None
    # Of two, whose stamps are off by less than they are late by, either may be.
    either = len(rig.flows) == 2 and (abs(by) < max(100 * MS, 2 * late) or 0 <= delay < 100 * MS)
    topics = frozenset(each.topic for each in rig.flows) if either else frozenset({flow.topic})
    # Of two free-running inputs it is the distance of neighbours that is seen, and no more than that where some take so
    # much longer on their way that it can't be said which were sent together.
    nearest = int(np.median(spans(rig)))
    is_seen = abs(by) < 0.4 * period or late < 0.15 * period
    sizes = (abs(by), abs(by + phase), *(() if is_seen else (nearest,)))
    return Truth(frozenset(codes.split()), topics, rig.seen(), sizes, moments=is_seen)


@_kind(same_rate=True)
def offset(rig: Rig) -> Truth | None:
    """Stamps of an input are off by the same time, within a few periods."""
    period, chance = rig.slowest, rig.chance
    by = chance.choice(
        [
            rig.slop * chance.uniform(1.5, 4),
            period * chance.uniform(0.6, 3),
            period * chance.choice([1, 2, 3]) + rig.slop * chance.uniform(-0.8, 0.8),
        ]
    )
    return None if by > 0.9 * S else _shift(rig, _one(rig), _sign(rig) * round(by), "over_slop constant_offset")


@_kind()
def stamped_late(rig: Rig) -> Truth | None:
    """A driver stamps as it publishes, and not as it measures."""
    flow = _one(rig)
    by = round(_log(rig, 20, 300) * MS)
    flow.received = flow.received + by
    truth = _shift(rig, flow, by, "over_slop constant_offset")
    if truth is None or by > rig.slowest / 2:
        return None
    # It is as late as it is stamped late: all that shows is how near the stamps are, at least, usually and at most.
    least, nearest, most = np.quantile(spans(rig), [0.02, 0.5, 0.95]).tolist()
    # Of two, either may be. Beside one that comes so often that its messages are near to all, the others have only
    # each other.
    slow = [each for each in rig.flows if each is flow or each.period > 2 * by]
    topics = truth.topics if len(rig.flows) in (2, len(slow)) else frozenset(each.topic for each in slow)
    return replace(truth, topics=topics, sizes=(*truth.sizes, least, nearest, most), moments=nearest > 0.8 * by)


@_kind(policies=_ANY)
def far_off(rig: Rig) -> Truth | None:
    """Another clock, by seconds to hours."""
    by = _sign(rig) * _log(rig, 1.3, 7000)
    flow = _one(rig)
    if any(abs(by - known) < 2 for known in (18, 37, -18, -37)) or _is_trigger_at_once(rig, flow):
        return None
    flow.stamps = flow.stamps + round(by * S)
    # What lies whole periods off is a result that takes that long as like as not, as is a trigger that is behind.
    if ("slop" in rig.options and _lost(rig) < 0.95) or (by < 0 and "trigger" in rig.options):
        return None
    return _truth("other_clock", flow, rig.seen(), (abs(by) * S,), moments="slop" in rig.options)


@_kind()
def two_of_a_host(rig: Rig) -> Truth | None:
    """Two inputs are of the clock of another host, which is off by seconds to hours."""
    by = _sign(rig) * _log(rig, 1.3, 7000)
    if len(rig.flows) < 3 or any(abs(by - known) < 2 for known in (18, 37, -18, -37)):
        return None
    two = rig.chance.sample(rig.flows, 2)
    for flow in two:
        flow.stamps = flow.stamps + round(by * S)
    topics = frozenset(each.topic for each in two)
    return Truth(frozenset({"other_clock"}), topics, rig.seen(), (abs(by) * S,)) if _lost(rig) >= 0.95 else None


def _is_trigger_at_once(rig: Rig, flow: Flow) -> bool:
    """Whether another clock shows otherwise: what is held serves any trigger that is not older."""
    return rig.options["policy"] == "latest_time" and flow.topic != rig.options["trigger"]


def _time_scale(rig: Rig, by: float, *says: str) -> Truth | None:
    flow = _one(rig)
    if _is_trigger_at_once(rig, flow):
        return None
    flow.stamps = flow.stamps + round(by * S)
    return _truth("other_clock", flow, rig.seen(), says=says, moments="slop" in rig.options)


@_kind(policies=_ANY)
def tai(rig: Rig) -> Truth | None:
    return _time_scale(rig, 37, "TAI")


@_kind(policies=_ANY)
def gps(rig: Rig) -> Truth | None:
    return _time_scale(rig, rig.chance.choice([18, -315_964_782]), "GPS")


@_kind(policies=_ANY)
def local_time(rig: Rig) -> Truth | None:
    return _time_scale(rig, 1800 * rig.chance.choice([each for each in range(-24, 28) if each]), "local time")


@_kind(policies=_ANY)
def uptime(rig: Rig) -> Truth | None:
    """Stamps count from boot."""
    return _time_scale(rig, -rig.began / S + _log(rig, 20, 3_000_000), "boot")


@_kind()
def simulated(rig: Rig) -> Truth | None:
    """One input is stamped with simulated time, which may not pass as fast."""
    flow = _one(rig)
    factor = rig.chance.choice([1.0, 1.0, rig.chance.uniform(0.2, 0.9), rig.chance.uniform(1.2, 4)])
    flow.stamps = (flow.true * factor + _log(rig, 1, 1000) * S).astype(np.int64)
    return _truth("other_clock", flow, rig.seen(), says=("simulation",), moments=True)


@_kind()
def rate(rig: Rig) -> Truth | None:
    """Stamps of an input run at a wrong rate, from the right time on."""
    flow = _one(rig)
    factor = rig.chance.choice([0.1, 0.5, 2.0, rig.chance.uniform(0.3, 0.95), rig.chance.uniform(1.05, 3)])
    began = -_log(rig, 1, 100) * S
    flow.stamps = (rig.began + began + (flow.true - began) * factor).astype(np.int64)
    off = abs(factor - 1) * (5 + 5 * rig.slowest / S)
    return (
        _truth("other_clock", flow, max(5.0, rig.seen()), (factor,), unit="times") if off * S > 2 * rig.slop else None
    )


@_kind()
def nanosec_unit(rig: Rig) -> Truth | None:
    """The field nanosec holds micro- or milliseconds."""
    flow = _one(rig)
    unit, word = rig.chance.choice([(1000, "microseconds"), (1_000_000, "milliseconds")])
    if flow.hz < 1.5 or flow.period > 0.9 * S:
        return None
    flow.stamps = flow.stamps // S * S + flow.stamps % S // unit
    return _truth("other_clock", flow, rig.seen(periods=8), says=(word,))


@_kind()
def read_as_nanoseconds(rig: Rig) -> Truth | None:
    """Micro- or milliseconds since 1970 are taken for nanoseconds."""
    flow = _one(rig)
    unit, word = rig.chance.choice([(1000, "microseconds"), (1_000_000, "milliseconds")])
    flow.stamps = flow.stamps // unit
    return _truth("other_clock duplicates", flow, rig.seen(), says=(word,))


@_kind()
def sec_holds_ms(rig: Rig) -> Truth | None:
    """The field sec holds milliseconds: of the time since boot, or what 32 bits keep of that since 1970."""
    flow = _one(rig)
    since = rig.chance.choice([rig.began, round(_log(rig, 10, 500_000) * S)])
    ms = (flow.true + since) // MS
    flow.stamps = ((ms + 2**31) % 2**32 - 2**31) * S
    return _truth("other_clock duplicates time_jump", flow, rig.seen(), says=("milliseconds",))


@_kind(midway=1.0)
def restart_at_0(rig: Rig) -> Truth | None:
    """Stamps begin again at 0, as those of a device that was reset."""
    flow = _one(rig)
    of = flow.since(rig.begin)
    if not of.any():
        return None
    flow.stamps = np.where(of, flow.true - round(rig.begin * S) + 1 * MS, flow.stamps)
    codes = "other_clock clock_step time_jump"
    return _truth(codes, flow, rig.seen(), says=("boot", "restart", "0"), moments=True)


@_kind(midway=1.0)
def step(rig: Rig) -> Truth | None:
    """A clock is set, on or back."""
    flow, chance = _one(rig), rig.chance
    least = max(12 * flow.jitter, rig.slop, 5 * MS)
    by = chance.choice([_log(rig, 1, 20) * least, flow.period * chance.choice([1, 2]), _log(rig, 1, 7200) * S])
    if by < least:
        return None
    by = _sign(rig) * round(by)
    flow.stamps = np.where(flow.since(rig.begin), flow.stamps + by, flow.stamps)
    codes = "clock_step" if abs(by) < S else "clock_step other_clock time_jump"
    return _truth(codes, flow, rig.seen(), (abs(by),), moments=True)


@_kind(midway=1.0)
def two_steps(rig: Rig) -> Truth | None:
    """Two inputs step at once: their host's clock is set."""
    if len(rig.flows) < 3:
        return None
    by = _sign(rig) * round(_log(rig, max(1.0, 3 * rig.slop / S), 7200) * S)
    two = rig.chance.sample(rig.flows, 2)
    for flow in two:
        flow.stamps = np.where(flow.since(rig.begin), flow.stamps + by, flow.stamps)
    topics = frozenset(each.topic for each in rig.flows if abs(by) > S) or frozenset(each.topic for each in two)
    return Truth(frozenset({"clock_step", "other_clock", "time_jump"}), topics, rig.seen(), (abs(by),))


@_kind()
def drift(rig: Rig) -> Truth | None:
    """A crystal is off by 30 to 2,000 ppm."""
    flow, ppm = _one(rig), _sign(rig) * _log(rig, 30, 2000)
    # Farther ahead it would be off from the start, which is another fault.
    ahead = _log(rig, 0.01, 0.8) * rig.slop * -np.sign(ppm)
    flow.stamps = flow.stamps + (flow.true * ppm * 1e-6 + ahead).astype(np.int64)
    shows = (5 * MS + 4 * max(each.jitter for each in rig.flows)) / (abs(ppm) * 1e-6) / S
    return _truth("clock_drift", flow, rig.seen(shows), (abs(ppm),), unit="ppm", moments=True) if shows < 45 else None


@_kind()
def resolution(rig: Rig) -> Truth | None:
    """Stamps are multiples of 10 ms, 100 ms or 1 s."""
    flow, unit = _one(rig), rig.chance.choice([10, 100, 1000]) * MS
    exact = flow.stamps
    flow.stamps = exact // unit * unit
    left = spans(rig)
    if not len(left) or unit <= max(2 * rig.slop, 0.3 * flow.period) or (unit < flow.period and _lost(rig) < _MANY):
        return None
    # Two stamps show of what they are multiples.
    seen = rig.seen(max(0.0, 2 * (unit - flow.period) / S))
    began = np.searchsorted(flow.true, round(seen * S))
    cut = (exact - flow.stamps)[: began + 10]
    if np.ptp(cut) > _STANDS * unit:
        return _truth("over_slop duplicates", flow, seen, (unit,))
    # Of a period that is a multiple of the unit, all that shows is that they lie off by what was cut.
    topics = frozenset(each.topic for each in rig.flows) if len(rig.flows) == 2 else frozenset({flow.topic})
    return Truth(frozenset({"over_slop"}), topics, seen, (unit, *np.quantile(left, [0.02, 0.5, 0.95]).tolist()))


@_kind(policies=_ANY)
def repeats(rig: Rig) -> Truth | None:
    """Several messages share a stamp."""
    flow, n = _one(rig), rig.chance.choice([2, 3, 4])
    if _is_trigger_at_once(rig, flow):
        return None
    flow.stamps = np.repeat(flow.stamps[::n], n)[: len(flow.stamps)]
    return _truth("duplicates", flow, rig.seen(periods=8))


@_kind(policies=_ANY, midway=0.5)
def unstamped(rig: Rig) -> Truth | None:
    flow = _one(rig)
    flow.stamps = np.where(flow.since(rig.begin), 0, flow.stamps)
    return _truth("unstamped", flow, rig.seen())


@_kind(policies=_ANY, midway=0.5)
def malformed(rig: Rig) -> Truth | None:
    flow = _one(rig)
    flow.is_cut = flow.since(rig.begin)
    return _truth("malformed", flow, rig.seen())


@_kind(midway=0.5)
def out_of_order(rig: Rig) -> Truth | None:
    """Some messages come after later ones."""
    flow = _one(rig)
    of = (rig.rng.random(len(flow.true)) < rig.chance.uniform(0.1, 0.4)) & flow.since(rig.begin)
    by = round(flow.period * rig.chance.uniform(1.3, 3))
    # Before the first message that comes nothing is out of order.
    of[: np.searchsorted(flow.true, round(flow.starts * S)) + 1] = False
    flow.received = flow.received + of * by
    # Of so few messages, none may come late for a while.
    late = np.sort(flow.received[of])
    if len(late) < 3:
        return None
    # Stamps that fall by more than a second have jumped, as they do in the engine.
    return _truth("out_of_order" if by < S else "out_of_order time_jump", flow, max(rig.seen(), late[2] / S))


@_kind(midway=0.5)
def two_publishers(rig: Rig) -> Truth | None:
    """Two nodes publish a topic, by two clocks."""
    flow = _one(rig)
    by = _sign(rig) * round(_log(rig, 1.5, 3600) * S)
    other = Flow(
        flow.topic,
        flow.hz,
        flow.true,
        flow.stamps + by,
        flow.received + round(flow.period * rig.chance.uniform(0.2, 0.8)),
        flow.lateness,
        flow.jitter,
        f"{flow.topic}_other",
        starts=flow.starts,
        found=flow.found,
    )
    other.keep(other.since(rig.begin))
    begin = rig.begin
    other.shown = lambda second: second >= begin
    rig.flows.append(other)
    return _truth("several_publishers", flow, rig.seen(), (abs(by),))


@_kind(policies=_ANY, midway=1.0)
def silent(rig: Rig) -> Truth | None:
    flow = _one(rig)
    flow.keep(~flow.since(rig.begin))
    return _truth("silent", flow, rig.begin + max(5.0, 3 * flow.period / S)) if len(flow.true) > 4 else None


@_kind(policies=_ANY, midway=1.0)
def gone(rig: Rig) -> Truth | None:
    """A driver ends."""
    flow, begin = _one(rig), rig.begin
    flow.keep(~flow.since(begin))
    flow.shown = lambda second: second < begin
    return _truth("no_publisher", flow, begin + 1)


@_kind(policies=_ANY)
def never_there(rig: Rig) -> Truth | None:
    flow = _one(rig)
    flow.keep(flow.true < 0)
    flow.shown = lambda _: False
    return _truth("no_publisher", flow, 1)


@_kind(midway=0.5)
def pauses(rig: Rig) -> Truth | None:
    """An input pauses for 2 s, again and again."""
    flow, every = _one(rig), rig.chance.uniform(3.5, 7)
    pause = rig.chance.uniform(1.5, 2.5)
    if flow.period > 0.4 * S or flow.period < rig.slowest * 0.99:
        return None
    at = (flow.true / S - rig.begin) % every
    flow.keep(~flow.since(rig.begin) | (at < every - pause))
    # What is seen is how long no message came: up to two periods more.
    gaps = np.diff(flow.true)
    seen = gaps[gaps > pause * S].tolist()
    return _truth("few_sets", flow, rig.begin + 2 * every, (pause * S, *seen[:1], max(seen, default=0)))


@_kind(midway=0.5)
def loses(rig: Rig) -> Truth | None:
    """About a third of the messages of an input do not come."""
    flow, share = _one(rig), rig.chance.uniform(0.28, 0.5)
    # The share of so few is what came of chance, and it is that of the last ten seconds.
    seen = rig.begin + max(10.0, 30 * rig.slowest / S)
    if flow.period < rig.slowest * 0.99:
        return None
    came = ~flow.since(rig.begin) | (rig.rng.random(len(flow.true)) >= share)
    lost = float(np.mean(~came[flow.since(rig.begin) & ~flow.since(seen)])) if seen < LONGEST_S else 0.0
    flow.keep(came)
    return _truth("few_sets messages_lost", flow, seen, (lost,), unit="share") if lost > 0.25 else None


@_kind(policies=_ANY, midway=1.0)
def slowed(rig: Rig) -> Truth | None:
    flow, n = _one(rig), rig.chance.choice([2, 3, 4])
    of = flow.since(rig.begin)
    flow.keep(~of | (np.arange(len(of)) % n == 0))
    return (
        _truth("slowed", flow, rig.begin + 12 * n * flow.period / S, (flow.hz / n,), unit="Hz")
        if flow.hz * (rig.begin - flow.starts) > 40
        else None
    )


@_kind(midway=0.5)
def bursts(rig: Rig) -> Truth | None:
    """Messages of an input are held up, and come at once."""
    flow, every = _one(rig), rig.chance.uniform(0.8, 2.5)
    if flow.hz * every < 6:
        return None
    # A queue that is too short for it is another fault.
    rig.options["queue_size"] += round(2 * every * max(each.hz for each in rig.flows))
    begin = round(rig.begin * S)
    held = begin + np.ceil((flow.received - begin) / (every * S)) * (every * S)
    flow.received = np.where(flow.received > begin, held + np.arange(len(flow.true)) % 1000, flow.received).astype(
        np.int64
    )
    flow.received = np.maximum.accumulate(flow.received)
    return _truth("bursts", flow, rig.begin + 2 * every, (every * S,))


@_kind(midway=1.0)
def all_held(rig: Rig) -> Truth | None:
    """The network holds all up once, and then sends it at once."""
    held, begin = rig.chance.uniform(1, 3), rig.begin
    if any(each.hz * held < 6 for each in rig.flows):
        return None
    for number, each in enumerate(rig.flows):
        of = (each.received >= begin * S) & (each.received < (begin + held) * S)
        each.received = np.where(of, round((begin + held) * S) + number + np.arange(len(of)), each.received)
        each.received = np.maximum.accumulate(each.received)
    return _truth("bursts", None, begin + held, (held * S,))


@_kind()
def short_queue(rig: Rig) -> Truth | None:
    """Messages of an input come so late that those of the others have left the queue."""
    flow, late = _one(rig), rig.chance.uniform(0.2, 3)
    size = rig.chance.choice([2, 5, 10])
    if size == rig.options["queue_size"]:
        return None
    others = [each for each in rig.flows if each is not flow]
    if not any(each.hz * late > 2 * size + 3 for each in others):
        return None
    flow.received = flow.received + round(late * S)
    rig.options["queue_size"] = size
    # Results that come late, or stamps of another clock: both would look so.
    topics = frozenset(each.topic for each in rig.flows)
    return Truth(frozenset({"short_queue", "other_clock"}), topics, rig.seen(late), (), moments=True)


@_kind()
def narrow_slop(rig: Rig) -> Truth | None:
    """The slop is less than what sets span."""
    # Inputs that drift apart span more with time: it is what they span at first that shows.
    until = rig.seen(periods=10) + 7
    widths = spans(rig, [replace(each, stamps=each.stamps[~each.since(until)]) for each in rig.flows])
    if len(widths) < 10 or np.median(widths) < MS:
        return None
    rig.options["slop"] = f"{round(np.median(widths) * rig.chance.uniform(0.2, 0.9))}ns"
    return Truth(frozenset({"over_slop"}), frozenset(), rig.seen(periods=10), (), moments=True)


@_kind(policies=("latest_time",))
def low_max_age(rig: Rig) -> Truth | None:
    """Of a trigger's partners, the latest is older than max_age."""
    others = [each for each in rig.flows if each.topic != rig.options["trigger"]]
    oldest = max(each.period for each in others)
    rig.options["max_age"] = f"{round(oldest * rig.chance.uniform(0.05, 0.4))}ns"
    ages = np.max([_ages(rig, each) for each in others], axis=0)
    limit = float(rig.options["max_age"][:-2])
    return _truth("over_slop", None, rig.seen(periods=12)) if np.mean(ages > limit) > 0.4 else None


def _ages(rig: Rig, flow: Flow) -> np.ndarray:
    trigger = next(each for each in rig.flows if each.topic == rig.options["trigger"]).true[5:50]
    theirs = np.sort(flow.true)
    return trigger - theirs[np.clip(np.searchsorted(theirs, trigger, side="right") - 1, 0, len(theirs) - 1)]


@_kind(midway=0.5)
def optional_away(rig: Rig) -> Truth | None:
    """An optional input sends nothing, or nothing any more."""
    if len(rig.flows) < 3:
        return None
    flow = min(rig.flows, key=lambda each: each.period)
    flow.required = False
    rig.options["max_wait"] = "100ms"
    flow.keep(~flow.since(rig.begin))
    return _truth("waiting_for_optional silent", flow, rig.begin + max(5.0, 3 * rig.slowest / S))


@_kind(policies=_ANY)
def qos(rig: Rig) -> Truth | None:
    flow = _one(rig)
    flow.mismatch = Mismatch("reliability", "best_effort", "reliable")
    flow.keep(flow.true < 0)
    return _truth("incompatible_qos", flow, 1)


@_kind(policies=_ANY)
def other_type(rig: Rig) -> Truth | None:
    flow = _one(rig)
    flow.type = "sensor_msgs/msg/MagneticField"
    flow.keep(flow.true < 0)
    return _truth("other_type", flow, 1)


@_kind(midway=1.0)
def stalls(rig: Rig) -> Truth | None:
    """The relay gets no processor."""
    length = rig.chance.uniform(0.8, 3)
    if not any(each.hz * length > 5 for each in rig.flows):
        return None
    rig.stops.append((rig.begin, rig.begin + length))
    return _truth("too_slow", None, rig.begin + length, (length * S,))
