"""Trials answer, whatever numbers messages and the file have: those at the ends of 64 bits, none, or many of one."""

import random
from typing import Any

from syncrelay.config import load_text
from syncrelay.explain.nearest import as_arrays, shifted
from syncrelay.explain.other_stamps import by_other_stamps
from syncrelay.explain.trials import REQUIRED, Trials
from syncrelay.sync import Message
from tests.explain.scenario import BEGAN, IMU, MS, S
from tests.faults.extent import chosen
from tests.ros.configs import config

_DRAWN = chosen(short=40, long=600)
_LAST = 2**63 - 1
_ENDS = (0, -5, -BEGAN, BEGAN, BEGAN + 37 * S, 2**31 * S, 2**62, _LAST, -(2**62), -_LAST)
_KEYS = frozenset({"slop", "queue_size", "max_wait", "policy", "max_age"})


def _drawn(seed: int):
    """A group, and the stamps and times of receipt of each input's messages."""
    chance = random.Random(f"any numbers {seed}")
    topics: list[dict[str, Any]] = [{"topic": f"/t{index}", "type": IMU} for index in range(chance.choice([2, 2, 3]))]
    for topic in topics:
        topic.update(chance.choice([{}, {}, {"offset": chance.choice(["-37s", "4000000000s", "-9000000000s"])}]))
    group: dict[str, Any] = {
        "policy": chance.choice(["approximate_time", "approximate_time_eager", "exact_time", "latest_time"]),
        "topics": topics,
    }
    group |= {"queue_size": chance.choice([1, 10]), "max_wait": chance.choice(["100ms", "3000000000s"])}
    if group["policy"] == "latest_time":
        group |= {
            "trigger": "20 Hz",
            "queue_size": 10,
            "max_wait": "100ms",
            "max_age": chance.choice(["1ms", "9000000000s"]),
        }
    elif group["policy"] != "exact_time":
        group["slop"] = chance.choice(["1ms", "9000000000s"])
    if chance.random() < 0.3:
        topics[-1]["required"] = False
    return load_text(config({"front": group})).groups[0], [_came(chance) for _ in topics]


def _came(chance: random.Random) -> list[tuple[int, int]]:
    first, period = chance.choice(_ENDS), chance.choice([0, 10 * MS, 100 * MS])
    stamps = [first + number * period for number in range(chance.choice([0, 1, 5, 30]))]
    strays = chance.choice([0, 0, 0.3])
    stamps = [chance.choice(_ENDS) if chance.random() < strays else stamp for stamp in stamps]
    return [
        (max(-_LAST, min(_LAST, stamp)), BEGAN + number * max(period, MS) + chance.randrange(3 * MS))
        for number, stamp in enumerate(stamps)
    ]


def _ask_everything(group, came):
    messages = [Message(index, *each) for index, of_input in enumerate(came) for each in of_input]
    messages.sort(key=lambda each: each.payload)
    for is_window in (True, False):
        trials = Trials(group, lambda: messages, as_arrays(messages, len(came)), is_window=is_window)
        for target in (REQUIRED, *trials.optional):
            trials.verdict(target, _KEYS)
            for index in range(len(came)):
                by_other_stamps(trials, index, target)
        offsets = [*trials.offsets(), *filter(None, map(trials.clock_offset, range(len(came))))]
        for offset in offsets:
            trials.by_offset(offset)


def test_any_numbers_are_answered():
    for seed in range(_DRAWN):
        _ask_everything(*_drawn(seed))


def test_an_offset_does_not_turn_the_latest_stamp_into_the_earliest():
    (stamps, *_) = as_arrays([Message(0, _LAST, BEGAN)], 1)
    assert shifted(stamps.stamps[:], 1)[0] > 0
