"""Traces of devices with clocks of their own, drawn by seed: what was stamped, when it was received, and when it was.

A device is off by up to 200 ppm, which wanders slowly. The way takes a least time and a jitter of 0.1 to 20 ms on
average, in one of five shapes, in order or not. It may hold messages up and give them at once. The clock is set or
begins anew some times, and for a minute nothing comes. All times are in nanoseconds of the host but for the stamps.
"""

import math
import random
from collections.abc import Callable, Iterator
from typing import NamedTuple

SECOND = 1_000_000_000
_BEGAN_S = 1_700_000_000.0
# What is known of a clock so long after the start, and after it was set.
_KNOWN_S, _KNOWN_AGAIN_S = 30.0, 5.0


class Sample(NamedTuple):
    """`true` is when it was captured, plus the least delay; `is_known` says that a mapping should have it by now."""

    stamp: int
    received: int
    true: int
    is_known: bool


class Trace(NamedTuple):
    samples: list[Sample]
    jitter_s: float

    @property
    def tolerance(self) -> float:
        """How far off a mapped stamp may be: half a millisecond, or a tenth of the jitter."""
        return max(0.5e-3, 0.1 * self.jitter_s) * SECOND

    def errors(self, mapped: Callable[[int, int], int]) -> list[float]:
        """How far off each known stamp is mapped."""
        pairs = [(each, mapped(each.stamp, each.received)) for each in self.samples]
        return [abs(host - each.true) for each, host in pairs if each.is_known]


def trace(seed: str, *, seconds: float = 600.0, settings: int = 3, has_outage: bool = True) -> Trace:
    chance = random.Random(f"trace {seed}")
    period = 1 / _log_uniform(chance, 5, 200)
    jitter_s = _log_uniform(chance, 0.1e-3, 20e-3)
    jitter = _jitter(chance, jitter_s)
    least = _log_uniform(chance, 0.1e-3, 50e-3)
    wanders = _wandering(chance)
    holds = _holds(chance, seconds) if chance.random() < 0.4 else []
    is_in_order = bool(holds) or chance.random() < 0.5
    quiet = chance.uniform(40, seconds - 100) if has_outage else -100.0
    moments = sorted(chance.uniform(20, seconds - 20) for _ in range(settings))
    offset, set_at = chance.choice([0.0, chance.uniform(-1, 1), chance.uniform(-1e9, 1e9)]), -1e9
    samples, newest, at = [], 0.0, chance.uniform(0, period)
    while at < seconds:
        while moments and moments[0] <= at:
            set_at = moments.pop(0)
            offset = _set(chance, offset, _BEGAN_S + at)
        if not quiet <= at < quiet + 60:
            came = at + least + jitter()
            came = max([came, *(end for begin, end in holds if begin <= came < end)])
            came = max(came, newest + 1e-5) if is_in_order else came
            newest = max(newest, came)
            is_known = at >= _KNOWN_S and at - set_at >= _KNOWN_AGAIN_S
            stamp, received, true = (_BEGAN_S + at + wanders(at) + offset, _BEGAN_S + came, _BEGAN_S + at + least)
            samples.append(Sample(_ns(stamp), _ns(received), _ns(true), is_known))
        at += period + chance.gauss(0, 0.01 * period)
    return Trace(sorted(samples, key=lambda sample: sample.received), jitter_s)


def rig(seed: str) -> Trace:
    """A trace as long as one watches a rig, of a clock that is mostly left alone."""
    chance = random.Random(f"rig {seed}")
    settings = chance.choice([0, 0, 1, 1, 2, 3])
    return trace(seed, seconds=chance.uniform(60, 120), settings=settings, has_outage=False)


def _set(chance: random.Random, offset: float, now: float) -> float:
    """Return how far off a clock is after it was set by some time, or to any time, or began at 0."""
    by = chance.choice([-1, 1]) * _log_uniform(chance, 0.05, 10)
    return chance.choice([offset + by, offset + by, chance.uniform(-1e9, 1e9), chance.uniform(0, 3) - now])


def _jitter(chance: random.Random, mean: float) -> Callable[[], float]:
    shapes: list[Callable[[], float]] = [
        lambda: chance.expovariate(1 / mean),
        lambda: chance.gammavariate(2, mean / 2),
        lambda: chance.lognormvariate(math.log(mean) - 0.5, 1),
        lambda: chance.uniform(0, 2 * mean),
        lambda: chance.expovariate(1 / (0.4 * mean if chance.random() < 0.9 else 6.4 * mean)),
    ]
    return chance.choice(shapes)


def _wandering(chance: random.Random) -> Callable[[float], float]:
    """Return how far a clock has drifted at a time: along a line and a slow wave."""
    rate, more, wave = chance.uniform(-200e-6, 200e-6), chance.uniform(0, 5e-6), _log_uniform(chance, 300, 3000) / 6.28
    phase = chance.uniform(0, 6.28)
    return lambda at: rate * at + more * wave * (math.cos(phase) - math.cos(at / wave + phase))


def _holds(chance: random.Random, seconds: float) -> list[tuple[float, float]]:
    """Return from when to when nothing comes through, and then all at once."""

    def each() -> Iterator[tuple[float, float]]:
        every, at = chance.uniform(3, 30), 0.0
        while at < seconds:
            at += chance.expovariate(1 / every)
            yield at, at + chance.uniform(0.1, 1.5)

    return list(each())


def _log_uniform(chance: random.Random, least: float, most: float) -> float:
    return math.exp(chance.uniform(math.log(least), math.log(most)))


def _ns(seconds: float) -> int:
    # To microseconds: a float holds no more of a time since 1970.
    return round(seconds * 1e6) * 1000
