"""What is said of draws with fixed seeds, from their begin to their end, and shown in the status."""

import contextlib
import hashlib
import json
import random
from array import array
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from syncrelay.config import ConfigError
from syncrelay.explain import CauseLog, ClockState, Distribution, Finding, GroupFacts, GroupReport, explanation, with_ok
from syncrelay.explain.finding_log import Remark
from syncrelay.explain.troubles import troubles
from syncrelay.status.as_document import group_of
from tests.bank.any_arrivals import judged
from tests.bank.any_facts import said_of
from tests.bank.any_rigs import played
from tests.bank.any_trials import answers
from tests.bank.kinds import KINDS
from tests.bank.play import Drawn, drawn, publishers_of
from tests.bank.rig import S
from tests.explain.scenario import Source, run
from tests.explain.scenario import group_of as scenario_group_of

# A block of what is drawn without a rig has so many draws.
_AT_ONCE: Final = 25

KNOWN: Final = Path(__file__).with_name("known.txt")
"""Of each draw a block that begins with its name: a line that is added, as `8 tai varied`, is one draw more."""


# What else a file may ask for, and what may happen beside a fault: each draw that is varied has some of either.
_KEYS: Final[tuple[dict[str, Any], ...]] = (
    {},
    {"max_rate": "3 Hz"},
    {"max_wait": "80ms"},
    {"quorum": 2},
    {"queue_size": 3},
    {"slop": "150ms"},
    {"policy": "latest_time", "trigger": "5 Hz", "max_age": "1s", "max_wait": "20ms"},
)
_OF_INPUT: Final[tuple[dict[str, Any], ...]] = (
    {},
    {"tolerance": "4ms"},
    {"required": False},
    {"stamp": "receive"},
    {"clock": "device"},
    {"offset": "3ms"},
    {"min_period": "20ms"},
)


# What happens beside.


def _is_paused(chance: random.Random, at: float) -> dict[str, Any]:
    return {"paused": [(at, at + chance.uniform(2, 8))]}


def _sleeps(chance: random.Random, at: float) -> dict[str, Any]:
    return {"sleeps": [(round(at), round(at + chance.uniform(2, 8)))]}


def _stands_still(chance: random.Random, at: float) -> dict[str, Any]:
    return {"stops": [(at, at + chance.uniform(0.3, 3))]}


def _clock_stops(chance: random.Random, at: float) -> dict[str, Any]:
    end = at + chance.uniform(4, 9)
    return {
        "facts": lambda second: {
            "clock": ClockState(received=True, stopped=round((second - at) * S) if at < second < end else None)
        }
    }


def _leaves_what_was_lost(chance: random.Random, at: float) -> dict[str, Any]:
    lost = chance.randrange(1, 50)
    return {"facts": lambda second: {"waited": round(lost * 0.02 * S) if second > at else 0, "is_look": lost % 2 == 0}}


def _nothing(_chance: random.Random, _at: float) -> dict[str, Any]:
    return {}


_BESIDE: Final = (_nothing, _is_paused, _sleeps, _stands_still, _clock_stops, _leaves_what_was_lost)


class Fixed(NamedTuple):
    """A draw by its seed and kinds: of one fault, of two of all, or of none; its rig may be varied."""

    seed: int
    kinds: str
    is_varied: bool

    @classmethod
    def named(cls, name: str) -> "Fixed":
        seed, kinds, *varied = name.split()
        return cls(int(seed), kinds, bool(varied))

    @property
    def name(self) -> str:
        return f"{self.seed} {self.kinds}{' varied' if self.is_varied else ''}"

    def drawn(self) -> Drawn:
        n_faults = {"well": 0, "two": 2}.get(self.kinds, 1)
        return drawn(self.seed, tuple(KINDS) if n_faults != 1 else (self.kinds,), n_faults)


def fixed() -> list[Fixed]:
    """Return the draws that the file names."""
    return [Fixed.named(block.partition("\n")[0]) for block in KNOWN.read_text().split("\n\n")]


def known(fixed: Fixed) -> str:
    """Write down what is known of a draw: without a rig how often what is told, and a digest of all that is.

    Of a rig when the code of what explains most changed, with its words, and digests of all shown and all observed.
    """
    if (told := _WITHOUT_A_RIG.get(fixed.kinds)) is not None:
        return "\n".join([fixed.name, *_told(told, fixed)])
    draw, lines, digest, before, log = fixed.drawn(), [fixed.name], hashlib.sha256(), "", CauseLog()
    observed = hashlib.sha256()
    sources, options, beside = draw.sources, draw.rig.options, dict[str, Any](stops=draw.rig.stops)
    if fixed.is_varied:
        words, sources, options, more = _varied(draw, random.Random(fixed.name))
        lines.append(words)
        beside |= more

    def hears(second: float, facts: GroupFacts, found: tuple[Finding, ...], remarks: list[Remark]) -> None:
        nonlocal before
        shown = explanation(with_ok(facts, found))
        if shown.code.value != before:
            before = shown.code.value
            lines.append(f"{second:.2f} {before}: {shown.text}; {shown.suggestion or ''}")
        digest.update(_shown(facts, found, remarks, log).encode())
        observed.update(str(_plain(facts)).encode())

    shown = publishers_of(draw.rig.flows)
    seconds = int(draw.seconds) + 1
    run(*sources, seconds=seconds, options=options, publishers=shown, looks=draw.looks, hears=hears, **beside)
    return "\n".join([*lines, f"{digest.hexdigest()[:12]} {observed.hexdigest()[:12]}"])


def _shown(facts: GroupFacts, found: tuple[Finding, ...], remarks: list[Remark], log: CauseLog) -> str:
    """Return what is shown in the status, logged and told of causes."""
    log.hear(facts, found, remarks, now=facts.figures.now)
    logged = [line.text for line in log.lines(now=facts.figures.now)]
    told = [each.text for each in troubles([(facts, found)], log.published_by)]
    return json.dumps([group_of(GroupReport(facts, found)).as_dict(), logged, told])


def _told(told: Callable[[random.Random], Iterable[tuple[str, str]]], fixed: Fixed) -> Iterator[str]:
    counts, digest = Counter[str](), hashlib.sha256()
    for number in range(fixed.seed * _AT_ONCE, (fixed.seed + 1) * _AT_ONCE):
        for what, text in told(random.Random(f"{fixed.kinds} {number}")):
            counts[what] += 1
            digest.update(text.encode())
    yield ", ".join(f"{what} {counts[what]}" for what in sorted(counts) if what)
    yield digest.hexdigest()[:12]


def _seen(chance: random.Random) -> Iterator[tuple[str, str]]:
    for facts, found in judged(chance.randrange(10**9)):
        yield "", str(_plain(facts))
        yield from ((each.code.value, str(each)) for each in found)


def _played(chance: random.Random) -> Iterator[tuple[str, str]]:
    said, log = list[tuple[str, str]](), CauseLog()

    def hears(_second: float, facts: GroupFacts, found: tuple[Finding, ...], remarks: list[Remark]) -> None:
        said.append(("", f"{_shown(facts, found, remarks, log)} {_plain(facts)}"))
        said.extend((each.code.value, str(each)) for each in with_ok(facts, found))

    played(chance, hears)
    yield from said


_WITHOUT_A_RIG: Final = {
    "facts": said_of,
    "trials": answers,
    "arrivals": _seen,
    "rigs": _played,
}


def _plain(value: Any) -> Any:
    """Return facts as lists of numbers and texts, alike wherever they were made."""
    match value:
        case Distribution():
            return [*value.newest(len(value))]
        case float():
            return f"{value:.9g}"
        case array():
            return value.tolist()
        case Mapping():
            return [_plain(each) for each in value.items()]
        case tuple() | list():
            return [*value] if value and isinstance(value[0], int) else [_plain(each) for each in value]
    return [_plain(getattr(value, each.name)) for each in fields(value) if each.repr] if is_dataclass(value) else value


def _on_a_grid(draw: Drawn, chance: random.Random) -> str:
    """Have all happen at few moments: what is compared with a limit is then often equal to it."""
    ms = chance.choice([5, 20, 50, 100])
    step = ms * 1_000_000
    for flow in draw.rig.flows:
        flow.stamps, flow.received = flow.stamps - flow.stamps % step, flow.received - flow.received % step
    draw.looks[:] = [float(second) for second in range(1, int(draw.seconds) + 1)]
    return f"on a grid of {ms} ms, "


def _with_losses(draw: Drawn, chance: random.Random) -> str:
    share = chance.uniform(0.01, 0.2)
    for flow in draw.rig.flows:
        flow.keep(np.array([chance.random() > share for _ in flow.true], dtype=np.bool_))
    return f"without {share:.0%} of the messages, "


def _as_drawn(_draw: Drawn, _chance: random.Random) -> str:
    return ""


_CHANGED: Final = (_as_drawn, _on_a_grid, _on_a_grid, _with_losses)


def _varied(draw: Drawn, chance: random.Random) -> tuple[str, list[Source], dict[str, Any], dict[str, Any]]:
    """Draw what else is asked for and happens, as far as that goes together: in words, and as `run` takes it."""
    changed = chance.choice(_CHANGED)(draw, chance)
    while True:
        keys, of_input, beside = chance.choice(_KEYS), chance.choice(_OF_INPUT), chance.choice(_BESIDE)
        first, *others = draw.sources
        required = bool(of_input.get("required", first.required))
        options = {key: value for key, value in of_input.items() if key != "required"}
        sources = [replace(first, required=required, topic_options={**first.topic_options, **options}), *others]
        options = {**({"queue_size": 10} if "policy" in keys else draw.rig.options), **keys}
        with contextlib.suppress(ConfigError):
            scenario_group_of(sources, options)
            words = f"{changed}with {keys}, {of_input} at {first.topic}, {beside.__name__.removeprefix('_')}"
            return words, sources, options, beside(chance, draw.rig.begin + chance.uniform(2, 15))
