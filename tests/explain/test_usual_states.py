"""What is as it is meant to be is no lasting warning: an optional input that is away, a recording in a loop."""

import random

import pytest

from syncrelay.explain import Endpoint, Finding, GroupFacts, GroupReport
from syncrelay.status import Level, level
from tests.explain.scenario import Source, Told, run
from tests.faults.extent import chosen

_SEEDS = range(chosen(short=2, long=200))
_SECONDS = 110
_POLICIES = (
    {"slop": "30ms", "max_wait": "50ms"},
    {"policy": "approximate_time_eager", "slop": "60ms", "max_wait": "50ms"},
    {"policy": "latest_time", "trigger": "/lidar", "max_age": "1s"},
)


def _levels(*sources: Source, seconds: int, **keys) -> tuple[Told, dict[float, Level]]:
    """What is told, and at each second what /diagnostics has for a level."""
    levels: dict[float, Level] = {}

    def hear(second: float, facts: GroupFacts, found: tuple[Finding, ...], _remarks: object) -> None:
        levels[second] = level(GroupReport(facts, found))

    return run(*sources, seconds=seconds, hears=hear, **keys), levels


@pytest.mark.parametrize("seed", _SEEDS)
def test_an_optional_input_that_is_away_is_a_warning_for_a_minute_and_one_line(seed: int):
    chance = random.Random(seed)
    away = chance.choice([0.0, chance.uniform(10, 20)])
    leaves_graph, hz, options = chance.random() < 0.5, chance.choice([5, 10]), chance.choice(_POLICIES)
    case = f"seed {seed}: away from {away}, {leaves_graph=}, {hz} Hz, {options}"

    def publishers(topic: str, second: float) -> tuple[Endpoint, ...]:
        is_gone = topic == "/imu" and leaves_graph and second >= away
        return () if is_gone else (Endpoint(f"{topic}_driver", "sensor_msgs/msg/Imu"),)

    told, levels = _levels(
        Source("/camera", hz=10),
        Source("/lidar", hz=5, phase_ms=20),
        Source("/imu", hz=hz, required=False, sends=lambda second: second < away),
        seconds=_SECONDS,
        seed=seed,
        options=options,
        publishers=publishers,
    )
    lines = [line for line in told.lines if line.code in ("no_publisher", "silent", "waiting_for_optional")]
    assert len(lines) == 1, (case, told.lines)
    assert lines[0].warns, case
    assert Level.WARN in levels.values(), case
    later = {second: each for second, each in levels.items() if second >= away + 75}
    assert later, case
    assert set(later.values()) == {Level.OK}, (case, told.found[-1])
    # It is in /status as long as it is so.
    assert any("/imu" in each.text for _, found in told.found[-1:] for each in found), case


@pytest.mark.parametrize("seed", _SEEDS)
def test_a_recording_that_is_played_in_a_loop_is_no_warning(seed: int):
    chance = random.Random(seed)
    # Stamps that fall by less than a second are out of order.
    length = chance.choice([chance.uniform(2, 5), chance.uniform(5, 30)])
    # A player begins again within some tenths of a second.
    gap, ago = chance.choice([0.0, chance.uniform(0, 0.9)]), chance.choice([chance.uniform(5, 60), 3600, 1e6])
    options = chance.choice(_POLICIES)

    def looped(topic: str, hz: float, *, required: bool = True) -> Source:
        return Source(
            topic,
            hz=hz,
            node="/player",
            jitter_ms=1,
            delay_jitter_ms=2,
            required=required,
            sends=lambda second: second % (length + gap) < length,
            clock=lambda second: -(length + ago) - second // (length + gap) * (length + gap),
        )

    told, levels = _levels(
        looped("/camera", 10),
        looped("/lidar", 5),
        looped("/imu", 20, required="policy" in options),
        seconds=80,
        seed=seed,
        options=options,
    )
    case = f"seed {seed}: passes of {length:.2f} s, {gap:.2f} s apart, recorded {ago} s ago, {options}"
    assert not told.warnings, case
    assert not told.ever_found, case
    assert set(levels.values()) == {Level.OK}, case
