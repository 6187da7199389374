"""Rigs that are wrong in several ways at once: each input in its own, in what is asked of it, and in what happens.

They last for seconds and send a few messages in each, so that many are played; on a grid, so that what is compared
with a limit is often equal to it. What is suggested is tried on the last messages, or on all, as of a recording.
"""

import random
from collections.abc import Callable
from contextlib import suppress
from dataclasses import fields, replace
from typing import Any, Final

from syncrelay.config import ConfigError, GroupConfig
from syncrelay.explain import Finding, GroupFacts
from syncrelay.explain.finding_log import Remark
from syncrelay.explain.input_observation import InputObservation
from syncrelay.explain.received import as_arrays
from syncrelay.explain.trials import Trials
from syncrelay.sync import Message
from tests.bank.dials import Dial
from tests.explain.scenario import BEGAN, MS, S, Source, group_of, run

Hears = Callable[[float, GroupFacts, tuple[Finding, ...], list[Remark]], None]
Came = list[tuple[float, int | None]]

# Of an input alone so many seconds are observed.
_OBSERVED_S: Final = 20
# What may be moved: stamps, times of receipt or both, all by as much, or each by more than the one before it.
_MOVES: Final = {
    "stamps": (1, 0, False),
    "received": (0, 1, False),
    "messages": (1, 1, False),
    "pace_of_stamps": (1, 0, True),
    "pace": (1, 1, True),
}
# A rig at a limit is played for so many seconds.
_SHORT_S: Final = 12
# A figure below this may be a count.
_FEW: Final = 300
# The messages themselves.
_MANY: Final = frozenset({"stamps", "received", "delays", "nearest"})
# By how much stamps are off: little, by some periods, or as those of another clock are.
_OFF: Final = (
    *([n * MS for n in (3, -12, 20, 45, -60)],) * 2,
    *([n * MS for n in (100, -200, -400, 500, 900)],) * 2,
    [*(n * S for n in (1, -1, 2, -3, 18, 37, 600, -3600, 7200)), -BEGAN + 500 * S],
)
_RATES: Final = (0.5, 0.999, 1.0004, 1.001, 1.25, 2)
_KEYS: Final[tuple[dict[str, Any], ...]] = (
    *({"slop": each} for each in ("1ms", "5ms", "20ms", "20ms", "50ms", "100ms", "400ms", "3s")),
    {},
    {"policy": "approximate_epsilon_time", "slop": "20ms"},
    {"policy": "approximate_time_eager", "slop": "20ms"},
    {"policy": "approximate_time_eager", "slop": "150ms"},
    {"policy": "exact_time"},
    {"policy": "latest_time", "trigger": "/t0"},
    {"policy": "latest_time", "trigger": "/t0", "max_age": "100ms"},
    {"policy": "latest_time", "trigger": "/t1", "max_age": "2s"},
    {"policy": "latest_time", "trigger": "5 Hz"},
    {"policy": "latest_time", "trigger": "5 Hz", "max_age": "300ms", "max_wait": "60ms"},
    {"policy": "latest_time", "trigger": "200 Hz", "max_age": "90ms", "max_wait": "20ms"},
)
_MORE_KEYS: Final[tuple[dict[str, Any], ...]] = (
    {},
    {},
    {},
    {"max_wait": "50ms"},
    {"max_wait": "400ms"},
    {"max_rate": "2 Hz"},
    {"quorum": 2},
)
_OF_INPUT: Final[tuple[dict[str, Any], ...]] = (
    *({},) * 8,
    {"required": False},
    {"required": False},
    {"tolerance": "4ms"},
    {"tolerance": "15ms"},
    {"offset": "-37s"},
    {"offset": "20ms"},
    {"clock": "device"},
    {"clock": "device", "delay": "5ms"},
    {"stamp": "receive"},
    {"max_age": "80ms"},
)
_BESIDE: Final[tuple[dict[str, Any], ...]] = (
    {},
    {},
    {},
    {"stops": [(7.5, 9.0)]},
    {"stops": [(6.0, 6.6), (12.0, 14.0)]},
    {"paused": [(8.0, 10.0)]},
    {"sleeps": [(6, 9)]},
)

_BESIDE_SHORT: Final[tuple[dict[str, Any], ...]] = (
    {},
    {},
    {"stops": [(3.5, 5.0)]},
    {"paused": [(3.0, 5.0)]},
    {"sleeps": [(2, 4)]},
)


def played(chance: random.Random, hears: Hears) -> None:
    """Play such a rig, and tell of each look at it."""
    sources, options = _rig(chance)
    group = group_of(sources, options)
    run(
        *sources,
        seconds=chance.choice([12, 20, 32]),
        options=options,
        hears=hears,
        whole=chance.choice([None, None, lambda: _whole(group, sources)]),
        **chance.choice(_BESIDE),
    )


def _rig(chance: random.Random) -> tuple[list[Source], dict[str, Any]]:
    """Draw sources and what is asked of them, as far as that goes together."""
    while True:
        sources = [_source(f"/t{number}", chance) for number in range(chance.choice([2, 2, 3, 4]))]
        options = {
            "queue_size": chance.choice([1, 2, 4, 10, 10, 30]),
            **chance.choice(_KEYS),
            **chance.choice(_MORE_KEYS),
        }
        with suppress(ConfigError):
            group_of(sources, options)
            return sources, options


def dial_of_input(chance: random.Random) -> Dial | None:
    """Return what is observed of one input, by how far some of its stamps or arrivals are moved, or by their pace."""
    came = [(stamp, BEGAN + round(at * S)) for at, stamp in _came(chance) if stamp is not None and at < _OBSERVED_S]
    if not came:
        return None
    what, moves = chance.choice([*_MOVES.items()])
    first, after = sorted(chance.sample(range(len(came) + 1), 2))
    some = slice(first, chance.choice([first + 1, after, len(came)]))
    high = chance.choice([-1, 1]) * chance.choice([20 * MS, 150 * MS, S, 7 * S, 20 * S, 90_000 * S])
    return Dial(what, lambda by: _observed(_moved(came, some, moves, by)), 0, high)


def _moved(came: list[tuple[int, int]], some: slice, moves: tuple[int, int, bool], by: int) -> list[tuple[int, int]]:
    """Return messages of which some are stamped or received later, or each later than the one before it."""
    stamps, received, is_pace = moves
    last = max(1, len(came[some]) - 1)
    later = [by * place // last if is_pace else by for place in range(len(came[some]))]
    moved = [(stamp + stamps * more, at + received * more) for (stamp, at), more in zip(came[some], later, strict=True)]
    return sorted([*came[: some.start], *moved, *came[some.stop :]], key=lambda each: each[1])


def _observed(came: list[tuple[int, int]]) -> str:
    """Return what an input's figures are at each second."""
    input_seen, figures = InputObservation(), list[str]()
    for now in range(BEGAN + S, BEGAN + (_OBSERVED_S + 3) * S, S):
        input_seen.add([each for each in came if now - S < each[1] <= now])
        fed = sum(now - 10 * S < received <= now for _, received in came)
        seen = input_seen.figures(fed=fed, dropped={}, seconds=min(10.0, (now - BEGAN) / S), now=now)
        figures.append(str([_shown(getattr(seen, each.name)) for each in fields(seen) if each.name not in _MANY]))
    return "\n".join([*figures, str(input_seen.pace)])


def _shown(value: Any) -> Any:
    """Return a value; of a count strokes, as it is by no figure that another is as great."""
    return "|" * value if isinstance(value, int) and not isinstance(value, bool) and 0 < value < _FEW else value


def dial_of_rig(chance: random.Random) -> Dial:
    """Return what is seen and said of a short rig, by how far some messages of one of its inputs are moved."""
    sources, options = _rig(chance)
    beside, moved = chance.choice(_BESIDE_SHORT), chance.choice(sources)
    sent = moved.messages() if moved.messages else ()
    came = [(0 if stamp is None else stamp, BEGAN + round(at * S)) for at, stamp in sent if at < _SHORT_S]
    what, moves = chance.choice([*_MOVES.items()])
    first, after = sorted(chance.sample(range(len(came) + 1), 2)) if came else (0, 0)
    some = slice(first, chance.choice([first + 1, after, len(came)]))

    def said(by: int) -> str:
        later = [((at - BEGAN) / S, stamp or None) for stamp, at in _moved(came, some, moves, by)]
        found = list[str]()

        def hears(_second: float, facts: GroupFacts, findings: tuple[Finding, ...], remarks: list[Remark]) -> None:
            share = facts.figures.share
            counts = [share.left, share.possible, share.absent, *facts.figures.sets_since_without]
            found.append(f"{findings} {remarks} {facts.standing} {share} {[*map(_shown, counts)]}")

        others = [replace(each, messages=lambda: later) if each is moved else each for each in sources]
        run(*others, seconds=_SHORT_S, options=options, hears=hears, **beside)
        return "\n".join(found)

    return Dial(what, said, 0, chance.choice([-1, 1]) * chance.choice([20 * MS, 150 * MS, S, 7 * S]))


def _source(topic: str, chance: random.Random) -> Source:
    options = {**chance.choice(_OF_INPUT)}
    required, came = options.pop("required", True), _came(chance)
    return Source(topic, 1, required=required, topic_options=options, messages=lambda: came)


def _came(chance: random.Random) -> Came:
    """Draw when each message is received, in seconds, and its stamp."""
    period = chance.choice([40, 100, 100, 100, 200, 500]) * MS
    true = [chance.choice([0, 0, 0, 5 * MS, period // 2]) + n * period for n in range(32 * S // period)]
    for change in chance.sample(_SENT, chance.choice([0, 0, 0, 0, 1, 2])):
        true = change(true, chance)
    stamps = [BEGAN + at for at in true]
    for change in chance.sample(_STAMPED, chance.choice([0, 0, 0, 1, 1, 2])):
        stamps = change(stamps, chance)
    late, jitter = chance.choice([1, 1, 5, 5, 30, 120, 400, 1000, 2500]) * MS, chance.choice([0, 0, 1, 5, 20])
    received = [at + late + chance.randint(0, jitter) * MS for at in true]
    if chance.random() < 0.1:
        # They come several at a time.
        every = chance.choice([S // 2, 3 * S])
        received = [-(-at // every) * every + place % 10 for place, at in enumerate(received)]
    cut = chance.choice([*(0,) * 30, 0.05, 0.6])
    came = [(at / S, None if chance.random() < cut else stamp) for at, stamp in zip(received, stamps, strict=True)]
    return sorted(came, key=lambda each: each[0])


def _some_lost(values: list[int], chance: random.Random) -> list[int]:
    share = chance.choice([0.03, 0.1, 0.3, 0.6])
    return [each for each in values if chance.random() >= share]


def _none_for_a_while(values: list[int], chance: random.Random) -> list[int]:
    begin = chance.choice([0, 5, 10]) * S
    end = begin + chance.choice([S, 3 * S, 6 * S, 60 * S])
    return [each for each in values if not begin < each <= end]


def _fewer_later(values: list[int], chance: random.Random) -> list[int]:
    since, one_in = chance.choice([0, 8]) * S, chance.choice([2, 3])
    return [each for place, each in enumerate(values) if each < since or not place % one_in]


def _jitters(values: list[int], chance: random.Random) -> list[int]:
    most, unit = chance.choice([(1, MS), (4, 5 * MS), (3, 20 * MS), (10**6, 7)])
    return [each + chance.randint(0, most) * unit for each in values]


def _off(values: list[int], chance: random.Random) -> list[int]:
    by = chance.choice(chance.choice(_OFF))
    return [each + by for each in values]


def _off_later(values: list[int], chance: random.Random) -> list[int]:
    by, since = chance.choice(chance.choice(_OFF)), BEGAN + chance.choice([4, 8, 15]) * S
    return [each + by if each >= since else each for each in values]


def _runs_on(values: list[int], chance: random.Random) -> list[int]:
    rate = chance.choice(_RATES)
    return [BEGAN + round((each - BEGAN) * rate) for each in values]


def _rounded(values: list[int], chance: random.Random) -> list[int]:
    unit = chance.choice([10 * MS, 100 * MS, 250 * MS])
    return [each // unit * unit for each in values]


def _some_else(values: list[int], chance: random.Random) -> list[int]:
    """Have some unset, the same as the one before, or of before."""
    share = chance.choice([0.02, 0.1, 0.6])
    by = chance.choice([70 * MS, S])
    others = chance.choice([[0] * len(values), [*values[:1], *values], [each - by for each in values]])
    return [other if chance.random() < share else each for each, other in zip(values, others, strict=False)]


_SENT: Final = (_some_lost, _none_for_a_while, _fewer_later, _jitters)
_STAMPED: Final = (_off, _off, _off_later, _runs_on, _rounded, _some_else)


def _whole(group: GroupConfig, sources: list[Source]) -> Trials:
    messages = [
        Message(index, stamp, BEGAN + round(at * S))
        for index, source in enumerate(sources)
        for at, stamp in (source.messages() if source.messages else ())
        if stamp is not None
    ]
    messages.sort(key=lambda each: each.payload)
    return Trials(group, as_arrays(messages, len(sources)), is_window=False)
