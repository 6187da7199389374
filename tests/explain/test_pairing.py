"""Whether it is certain what belongs together: of drawn rigs, of which it is known how long each message took at least.

A slow input and a quicker one measure at the same times, or anyhow. The stamps of one are mapped: each is late by the
least time that its messages take.
"""

import random

import numpy as np

from syncrelay.explain.pairing import is_certain
from syncrelay.explain.received import as_arrays
from syncrelay.explain.trials import Trials
from syncrelay.sync import Message
from tests.explain.scenario import BEGAN, MS, Source, group_of
from tests.faults.extent import chosen

_SECONDS = 10
# Of inputs that send often it is certain sooner.
_MOST = 300


def a_rig(period_ms: float, other_ms: float, *, phase_ms: float, late_ms: float, slop_ms: float) -> Trials:
    """Input 0 has true stamps, and those of input 1 are late: by as much as its messages take to arrive."""
    messages = [
        Message(index, BEGAN + round(at * MS) + late, BEGAN + round(at * MS) + late)
        for index, period, phase, late in (
            (0, other_ms, 0, 0),
            (1, period_ms, phase_ms, round(late_ms * MS)),
        )
        for at in np.arange(phase, min(1000 * _SECONDS, _MOST * max(period_ms, other_ms)), period)
    ]
    messages.sort(key=lambda each: each.payload)
    config = group_of([Source("/camera", hz=1), Source("/lidar", hz=1)], {"slop": f"{slop_ms}ms"})
    return Trials(config, as_arrays(messages, 2), is_window=True)


def farthest_ms(rig: Trials, late_ms: float) -> float:
    """How far from its nearest, by mapped stamps, a message of the slower input was truly measured, of nearly all."""
    stamps = [rig.stamps(0)[:], rig.stamps(1)[:]]
    slow, quick = sorted((0, 1), key=lambda index: len(stamps[index]))
    true = [stamps[0], stamps[1] - round(late_ms * MS)]
    nearest = np.abs(stamps[slow][:, None] - stamps[quick][None, :]).argmin(axis=1)
    return float(np.quantile(np.abs(true[slow] - true[quick][nearest]), 0.97)) / MS


def test_what_is_certain_is_paired_rightly_however_long_its_messages_take():
    certain = 0
    for seed in range(chosen(short=200, long=5000)):
        chance = random.Random(f"pairing {seed}")
        period = chance.choice([1, 20, 100, 1000])
        other = period * chance.choice([0.1, 0.5, 1, 2, 10])
        late = chance.uniform(0, min(100, period / 2))
        quickest, phase = min(period, other), chance.choice([0, chance.uniform(0, 0.4)])
        slop = max(1.2 * phase * quickest, quickest * chance.choice([0.05, 0.3, 1, 3]))
        rig = a_rig(period, other, phase_ms=phase * quickest, late_ms=late, slop_ms=slop)
        if is_certain(rig, 1):
            certain += 1
            assert farthest_ms(rig, late) <= 1.01 * slop, (seed, period, other, phase, late, slop)
    # Not all that is certain is refused.
    assert certain > 0.2 * chosen(short=200, long=5000)


def test_nothing_is_certain_of_an_optional_input_without_a_message():
    messages = [Message(index, BEGAN + at, BEGAN + at) for at in range(0, 10**10, 10**8) for index in (0, 1)]
    optional = Source("/imu", hz=1, required=False)
    config = group_of([Source("/a", hz=10), Source("/b", hz=10), optional], {"slop": "10ms", "max_wait": "1s"})
    rig = Trials(config, as_arrays(messages, 3), is_window=True)
    assert not is_certain(rig, 2)
