"""Streams of any rates, jitters, losses and disorder, and an approximate_time for them."""

import random
from typing import Any

from syncrelay.sync import ApproximateTime
from tests.sync.support.rigs import START

MS = 1_000_000
SECOND = 1_000 * MS


class Rates:
    """What is drawn by a seed: a policy, and the input and stamp of each message as they come."""

    def __init__(self, seed: int) -> None:
        chance = self.chance = random.Random(seed)
        self.n_inputs = chance.randint(2, 5)
        self._options: dict[str, Any] = {
            "n_inputs": self.n_inputs,
            "queue_size": chance.choice((1, 2, 3, 5, 10, 10, 50)),
            "slop_ns": chance.choice((0, 1, 5 * MS, 20 * MS, 20 * MS, 50 * MS, None)),
            "age_penalty": chance.choice((0, 0.1, 0.1, 3.7, 1e6, 1e-9)),
            "min_periods_ns": [chance.choice((0, 0, 5 * MS, 30 * MS)) for _ in range(self.n_inputs)],
        }
        self._jitter, self._late = chance.choice((0, 0, 1, 3, 20)) * MS, chance.choice((0, 0, 2, 15, 60)) * MS
        # What a field gives as a stamp may be any number.
        self._begin = chance.choice((*(START,) * 8, -SECOND, 2**62 - SECOND, 2**63 - SECOND, -(2**62) - SECOND, 2**80))
        self._lost, self._disorder = chance.choice((0, 0, 0.02, 0.3)), chance.choice((0, 0, 0.01, 0.1))
        came = sorted(each for index in range(self.n_inputs) for each in self._of_input(index))
        self.messages = [(index, stamp) for _, index, stamp in came[:400]]

    def policy(self) -> ApproximateTime:
        return ApproximateTime(**self._options)

    def looks(self, most: int) -> set[int]:
        """After which messages somebody looks."""
        return set(self.chance.sample(range(len(self.messages)), min(len(self.messages), self.chance.randint(0, most))))

    def _of_input(self, index):
        chance = self.chance
        period, grain = chance.choice((5, 10, 33, 33, 50, 100, 500)) * MS, chance.choice((1, 1, 10 * MS))
        at, newest = self._begin + chance.randrange(period), self._begin - SECOND
        while at < self._begin + 3 * SECOND:
            stamp = newest = max(newest + 1, (at + round(chance.uniform(-self._jitter, self._jitter))) // grain * grain)
            if chance.random() < self._disorder:
                stamp -= chance.choice((1, 5 * MS, 100 * MS, 2 * SECOND, -(2**62), -(2**80), 2**80))
            if chance.random() >= self._lost:
                yield at + round(self._late * chance.random()), index, stamp
            at += period
            if chance.random() < 0.003:
                at += chance.randrange(2 * SECOND)
