"""Steps of a clock, told from levels of delays; what is true is drawn, and no code of the package has a say in it."""

import random

from syncrelay.explain.steps import StampSteps
from tests.explain.support.groups import BEGAN, MS, S
from tests.faults.extent import chosen


class Input:
    """Messages of one input, second by second, with a jitter that is never negative."""

    def __init__(self, chance: random.Random) -> None:
        self.chance = chance
        self.period = round(S / chance.choice([1, 5, 20, 100]))
        self.jitter = 10 ** chance.uniform(-1, 1) * MS
        self.steps = StampSteps()
        self.found: list[int] = []
        self.second = 0

    def play(self, seconds: int, *, late: int = 0, after_gap: bool = False, amid: bool = False) -> None:
        """Let so many seconds pass in which delays are so much greater; after a gap, messages come that much later.

        `amid` has the first messages of the first second be as before.
        """
        gap = late if after_gap else 0
        for second in range(self.second, self.second + seconds):
            first = BEGAN + second * S + gap
            received = [first + n * self.period for n in range(max(1, S // self.period))]
            old = self.chance.randrange(len(received)) if amid and second == self.second else 0
            delays = [
                round(5 * MS + (late if n >= old else 0) + self.chance.expovariate(1 / self.jitter))
                for n in range(len(received))
            ]
            at = self.steps.add(received, delays, min(delays), max(delays), period=lambda: self.period)
            self.found += [] if at is None else [at]
        self.second += seconds


def inputs(name: str):
    for seed in range(chosen(short=150, long=5000)):
        yield Input(random.Random(f"{name} {seed}"))


def test_a_clock_that_is_set_is_found_within_four_looks_with_its_size_and_time():
    missed = []
    for each in inputs("set"):
        by = each.chance.choice([-1, 1]) * round(5 * MS + 20 * each.jitter * each.chance.uniform(1, 20))
        each.play(20)
        each.play(4, late=-by)
        last = each.steps.last
        near = last is not None and abs(last.by - by) <= 0.2 * abs(by) and abs(last.at - BEGAN - 20 * S) <= 1.5 * S
        missed += [] if near and not each.steps.may_step else [(by, each.jitter, each.period, last)]
        each.play(20, late=-by)
        assert len(each.found) <= 1
    assert len(missed) <= chosen(short=2, long=50), missed


def test_of_a_clock_that_is_set_back_amid_a_look_nothing_is_remembered_of_before():
    remembered = []
    for each in inputs("amid"):
        by = round(5 * MS + 20 * each.jitter * each.chance.uniform(1, 20))
        each.play(20)
        each.play(20, late=by, amid=True)
        least = each.steps.least
        # Those of a level may differ by a quarter.
        remembered += [(by, least)] if each.steps.last and least is not None and least < 0.7 * by else []
    assert not remembered


def test_what_is_late_after_a_gap_and_in_time_again_is_no_step():
    told = []
    for each in inputs("late"):
        late = round(each.period + 5 * MS + 20 * each.jitter * each.chance.uniform(1, 20))
        each.play(20)
        each.play(each.chance.randint(1, 15), late=late, after_gap=True)
        each.play(20)
        told += [(late, each.jitter, each.period)] if each.steps.last else []
    assert len(told) <= chosen(short=2, long=50), told


def test_jitter_alone_is_no_step_and_leaves_nothing_open_for_long():
    told = 0
    for each in inputs("jitter"):
        each.play(chosen(short=60, long=600))
        told += each.steps.last is not None
    assert told <= chosen(short=1, long=10)
