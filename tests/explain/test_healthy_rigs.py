"""Healthy rigs in virtual time, and what may happen to a relay: nothing is found but that, at no moment."""

import random
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import pytest

from syncrelay.explain import Endpoint
from tests.explain.scenario import IMU, Noise, Source, run
from tests.faults.extent import chosen

pytestmark = pytest.mark.faults

REAL: Noise = {"jitter_ms": 1.0, "delay_jitter_ms": 2.0}
_SECONDS = 120
# By then, all is well again that was held up.
_RESTED_S = 55
_LATER = range(chosen(short=1, long=6))


class _Rig(NamedTuple):
    sources: Sequence[Source]
    options: dict[str, Any]


_LIDAR = Source("/lidar", 10, delay_ms=30, **REAL)
RIGS = {
    "camera and lidar": _Rig([Source("/camera", 30, delay_ms=20, **REAL), _LIDAR], {"slop": "30ms"}),
    "IMU, camera and GPS": _Rig(
        [
            Source("/imu", 200, delay_ms=2, jitter_ms=0.2, delay_jitter_ms=0.5),
            Source("/camera", 20, delay_ms=20, **REAL),
            Source("/gps", 1, delay_ms=80, **REAL),
        ],
        {"slop": "50ms", "queue_size": 450},
    ),
    "IMU and GPS, and one that may be missing": _Rig(
        [Source("/imu", 100, delay_ms=2, **REAL), Source("/gps", 1, **REAL), Source("/extra", 10, required=False)],
        {"slop": "50ms", "queue_size": 250, "max_wait": "200ms"},
    ),
    "an optional one that is slow and punctual": _Rig(
        [
            Source("/camera", 20),
            Source("/lidar", 10),
            Source("/gps", 0.5, phase_ms=20, jitter_ms=2, delay_jitter_ms=1, required=False),
        ],
        {"slop": "40ms", "max_wait": "60ms"},
    ),
    "a pose that is held": _Rig(
        [_LIDAR, Source("/pose", 2, **REAL)], {"policy": "latest_time", "trigger": "/lidar", "max_age": "1s"}
    ),
}


def _rests(chance: random.Random, lengths: Sequence[float], every_s: float) -> list[tuple[float, float]]:
    found, at = [], 5.0
    while at < _RESTED_S:
        found.append((at, at + chance.choice(lengths)))
        at = found[-1][1] + chance.expovariate(1 / every_s)
    return found


def _short_rests(chance: random.Random) -> list[tuple[float, float]]:
    return _rests(chance, (0.05, 0.2, 0.6, 1.5), 2)


def _long_rest(chance: random.Random) -> list[tuple[float, float]]:
    return [(30.25, 30.25 + chance.choice((3, 8, 20)))]


def _whole_seconds(rests: Sequence[tuple[float, float]]) -> list[tuple[int, int]]:
    return [(round(begin), round(end)) for begin, end in rests if round(begin) < round(end)]


class _Event(NamedTuple):
    """What happens, as keywords of `run` and options of the group; the code that may be found meanwhile."""

    keys: Callable[[random.Random], dict[str, Any]]
    options: dict[str, Any]
    found: set[str]
    is_said: bool
    """Whether the log may warn of it."""


EVENTS = {
    "nothing": _Event(lambda _: {}, {}, set(), is_said=False),
    "it is stopped": _Event(lambda chance: {"stops": _short_rests(chance)}, {}, {"too_slow"}, is_said=True),
    "it is starved": _Event(lambda chance: {"starved": _short_rests(chance)}, {}, {"too_slow"}, is_said=True),
    "it is stopped for long": _Event(lambda chance: {"stops": _long_rest(chance)}, {}, {"too_slow"}, is_said=True),
    "it is starved for long": _Event(lambda chance: {"starved": _long_rest(chance)}, {}, {"too_slow"}, is_said=True),
    "nobody listens": _Event(
        lambda chance: {"sleeps": _whole_seconds(_rests(chance, (1, 8, 40), 8))}, {"lazy": True}, set(), is_said=False
    ),
    "it is paused": _Event(
        lambda chance: {"paused": _rests(chance, (0.3, 3.0, 9.2, 30.0), 12)}, {}, {"paused"}, is_said=False
    ),
}

_CASES = [(name, event, seed) for name in RIGS for event in EVENTS for seed in range(3)]


@pytest.mark.parametrize(("name", "event", "seed"), chosen(short=_CASES[::13], long=_CASES))
def test_nothing_is_found_but_what_happens(name, event, seed):
    rig, happens = RIGS[name], EVENTS[event]
    keys = happens.keys(random.Random(seed))
    told = run(*rig.sources, seconds=_SECONDS, seed=seed, options={**rig.options, **happens.options}, **keys)
    case = f"{keys}: {told.lines}"
    assert happens.found <= told.ever_found, case
    if happens.is_said:
        # Its effects may be found for a moment, before they last long enough for a line.
        assert told.codes <= happens.found, case
        assert not told.lines or not told.lines[-1].warns, case
    else:
        assert told.ever_found == happens.found, case
        assert told.lines == [], case


@pytest.mark.parametrize("name", RIGS)
@pytest.mark.parametrize("seed", _LATER)
def test_of_a_rig_that_starts_later_than_the_relay_nothing_is_said(name, seed):
    """The graph shows each publisher at some moment, and its messages come then or up to 4 s later."""
    chance, rig = random.Random(f"{seed} {name}"), RIGS[name]
    shown = {each.topic: chance.uniform(0, 4.9) for each in rig.sources}
    begins = {topic: at + chance.choice([0.1, chance.uniform(0.1, 4)]) for topic, at in shown.items()}

    def since(begin: float) -> Callable[[float], bool]:
        return lambda at: at >= begin

    sources = [replace(each, sends=since(begins[each.topic])) for each in rig.sources]
    told = run(
        *sources,
        seconds=50,
        seed=seed,
        options=rig.options,
        publishers=lambda topic, at: (Endpoint(f"{topic}_driver", IMU),) if at >= shown[topic] else (),
    )
    assert told.warnings == [], (shown, begins)
