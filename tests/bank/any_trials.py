"""All that trials answer of drawn groups and messages: of rigs that may be well, and of any numbers.

Such are those at the ends of 64 bits, none, or many of one.
"""

import random
from collections.abc import Iterator
from typing import Any, Final

from syncrelay.config import GroupConfig, load_text
from syncrelay.explain.other_stamps import by_other_stamps, wandering
from syncrelay.explain.received import as_arrays
from syncrelay.explain.trials import REQUIRED, Trials
from syncrelay.sync import Message
from tests.bank.dials import Dial
from tests.explain.scenario import BEGAN, IMU, MS, S
from tests.ros.configs import config

_LAST: Final = 2**63 - 1
_ENDS: Final = (0, -5, -BEGAN, BEGAN, BEGAN + 37 * S, 2**31 * S, 2**62, _LAST, -(2**62), -_LAST)
_KEYS: Final = ("slop", "queue_size", "max_wait", "policy", "max_age")
_OF_INPUT: Final[tuple[dict[str, Any], ...]] = (
    {},
    {},
    {"offset": "-37s"},
    {"offset": "4000000000s"},
    {"offset": "20ms"},
)

Came = list[tuple[int, int]]


def any_trials(chance: random.Random) -> tuple[GroupConfig, list[Came]]:
    """Return a group, and the stamps and times of receipt of each input's messages."""
    n_inputs = chance.choice([2, 2, 3])
    topics = [{"topic": f"/t{index}", "type": IMU, **chance.choice(_OF_INPUT)} for index in range(n_inputs)]
    policy = chance.choice(["approximate_time", "approximate_time_eager", "exact_time", "latest_time"])
    group: dict[str, Any] = {
        "policy": policy,
        "topics": topics,
        "queue_size": chance.choice([1, 2, 10]),
        "max_wait": chance.choice(["100ms", "3000000000s"]),
    }
    wide = chance.choice(["1ms", "10ms", "80ms", "500ms", "9000000000s"])
    if policy == "latest_time":
        group |= {"trigger": chance.choice(["20 Hz", "/t0"]), "queue_size": 10, "max_wait": "100ms"}
        group |= chance.choice([{}, {"max_age": wide}, {"max_age": wide}])
    elif policy != "exact_time":
        group["slop"] = wide
    if chance.random() < 0.3:
        topics[-1]["required"] = False
    came = _of_a_rig if chance.random() < 0.7 else _any_numbers
    return load_text(config({"front": group})).groups[0], [came(chance) for _ in topics]


def _of_a_rig(chance: random.Random) -> Came:
    """Messages that are measured every so often, stamped by one clock or another, and late, or lost."""
    period, jitter = chance.choice([20, 20, 50, 100]) * MS, chance.choice([0, 0, MS, 10 * MS])
    off = chance.choice([0, 0, 0, 3 * MS, -12 * MS, 45 * MS, 37 * S])
    late, lost = chance.choice([0, 5 * MS, 150 * MS]), chance.choice([0, 0, 0.2])
    rate = chance.choice([1, 1, 1, 1.001])
    true = [BEGAN + n * period + chance.randint(0, jitter) for n in range(2 * S // period) if chance.random() >= lost]
    return [(at + off + round((at - BEGAN) * (rate - 1)), at + late + chance.randint(0, jitter)) for at in true]


def _any_numbers(chance: random.Random) -> Came:
    first, period = chance.choice(_ENDS), chance.choice([0, 10 * MS, 100 * MS])
    stamps = [first + number * period for number in range(chance.choice([0, 1, 5, 30]))]
    strays = chance.choice([0, 0, 0.3])
    stamps = [chance.choice(_ENDS) if chance.random() < strays else stamp for stamp in stamps]
    return [
        (max(-_LAST, min(_LAST, stamp)), BEGAN + number * max(period, MS) + chance.randrange(3 * MS))
        for number, stamp in enumerate(stamps)
    ]


def answers(chance: random.Random) -> Iterator[tuple[str, str]]:
    """Yield what trials answer to all that may be asked of them, with whether a value was found that helps."""
    group, came = any_trials(chance)
    texts = (text for is_window in (True, False) for text in _answers(group, came, is_window=is_window))
    yield from (("helps" if "Tried(" in text else "does not help", text) for text in texts)


def dial_of_trials(chance: random.Random) -> Dial | None:
    """Return what trials answer, by how far some messages of one input are moved."""
    group, came = any_trials(chance)
    index, is_window = chance.randrange(len(came)), chance.random() < 0.7
    if not came[index]:
        return None
    what, (of_stamps, of_receipt) = chance.choice([("stamps", (1, 0)), ("received", (0, 1)), ("messages", (1, 1))])
    first, after = sorted(chance.sample(range(len(came[index]) + 1), 2))
    some = chance.choice([range(first, after), range(len(came[index]))])

    def said(by: int) -> str:
        moved = [
            (max(-_LAST, min(_LAST, stamp + of_stamps * by)), at + of_receipt * by) if place in some else (stamp, at)
            for place, (stamp, at) in enumerate(came[index])
        ]
        return "\n".join(_answers(group, [*came[:index], moved, *came[index + 1 :]], is_window=is_window))

    return Dial(what, said, 0, chance.choice([-1, 1]) * chance.choice([5 * MS, 20 * MS, 200 * MS, 2 * S]))


def _answers(group: GroupConfig, came: list[Came], *, is_window: bool) -> Iterator[str]:
    messages = [Message(index, *each) for index, of_input in enumerate(came) for each in of_input]
    messages.sort(key=lambda each: each.payload)
    trials = Trials(group, as_arrays(messages, len(came)), is_window=is_window)
    yield str(trials.plan)
    for target in (REQUIRED, *trials.optional):
        yield str([trials.verdict(target, _KEYS), [trials.verdict(target, {key}) for key in _KEYS]])
        for index in range(len(came)):
            yield str([by_other_stamps(trials, index, target), wandering(trials, index)])
    offsets = [*trials.offsets(), *filter(None, map(trials.clock_offset, range(len(came))))]
    yield str([(offset, trials.by_offset(offset)) for offset in offsets])
