"""Random histories of an optional input: what is said of why sets leave without it has really been so."""

import random
import re
from collections.abc import Callable
from dataclasses import dataclass

import pytest

from tests.explain.scenario import Source, Told, run
from tests.explain.support.cases import said_of_cases
from tests.faults.extent import chosen

_SLOP_S = 0.02
_HZ = 10
_LASTS_S = 40
# All causes are named at these, but for an input that never came.
_SEEDS = chosen(short=[1, 3, 28], long=[*range(40)])


@dataclass
class _History:
    """One run: how the optional input comes."""

    chance: random.Random

    def __post_init__(self) -> None:
        self.max_wait_s = self.chance.choice([0.05, 0.1, 0.3])
        self.delay_s = self.chance.choice([0, 0, 0.02, 0.08, 0.15, 0.6])
        self.shift_s = self.chance.choice([0, 0, 0, 0, 0.045, -3, 40])
        self.pauses = sorted(self.chance.randint(0, _LASTS_S) for _ in range(self.chance.choice([0, 2, 4])))
        self.looks = range(1, _LASTS_S, self.chance.choice([1, 1, 4]))

    def sends(self, second: float) -> bool:
        return sum(second >= pause for pause in self.pauses) % 2 == 0

    def came(self, begin: float, end: float) -> bool:
        """Whether a message was received in that time."""
        sent = (number / _HZ for number in range(_LASTS_S * _HZ))
        return any(self.sends(second) and begin < second + self.delay_s + 0.006 <= end for second in sent)

    @property
    def is_late(self) -> bool:
        return self.delay_s > self.max_wait_s

    def run(self) -> Told:
        return run(
            *(Source(topic, _HZ, delay_jitter_ms=1) for topic in ("/a", "/b")),
            Source(
                "/c",
                _HZ,
                required=False,
                delay_ms=6 + self.delay_s * 1000,
                clock=lambda _: self.shift_s,
                sends=self.sends,
            ),
            seconds=_LASTS_S,
            options={"slop": f"{_SLOP_S}s", "max_wait": f"{self.max_wait_s}s"},
            looks=self.looks,
        )


def _template(text: str) -> str:
    """The cause in a sentence, without its figures."""
    return re.sub(r"[\d.]+ \w+", "N", text.partition(": ")[2]).replace("ahead of", "behind")


# When a cause that a case says is true.
_TRUE: dict[str, Callable[[_History, float], bool]] = {
    "an optional input that comes late": lambda history, _: history.is_late and not history.shift_s,
    "an optional input whose stamps fit no set": lambda history, _: abs(history.shift_s) > _SLOP_S,
    "an optional input of another clock": lambda history, _: abs(history.shift_s) > 1,
    "an optional input that went away": lambda history, at: not history.came(at - 1, at),
    "an optional input that never came": lambda history, at: not history.came(0, at),
    "an optional input that comes in time and is missing all the same": lambda *_: True,
}
_CAUSES = {_template(said_of_cases()[name][2]): name for name in _TRUE}


@pytest.mark.long
def test_no_cause_is_named_that_did_not_hold_and_none_of_an_input_that_is_in_every_set():
    named = set()
    for seed in _SEEDS:
        history = _History(random.Random(seed))
        is_in_sets = not (history.is_late or history.shift_s)
        for second, finding in history.run().findings("waiting_for_optional"):
            name = _CAUSES[_template(finding.text)]
            assert _TRUE[name](history, second), (seed, second, finding)
            assert not (is_in_sets and all(map(history.sends, range(round(second) - 8, round(second) + 1)))), seed
            named.add(name)
    assert named >= _TRUE.keys() - {"an optional input that never came"}
