"""Plays the rigs of tests/scenarios in virtual time, each at moments of its own: what a slow machine makes of a play.

By chance are: when the source starts before or after the relay, how long each act takes, how long after a publisher
its first message comes and when the graph shows it, when the relay looks, and whether a look comes late or all of the
relay stands still for a while. Seconds are those after the start of the relay.
"""

import math
import random
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

from syncrelay.explain import Endpoint, Mismatch, Standstill
from tests.explain.scenario import BEGAN, S, Source, Told, run
from tests.scenarios.rigs import ACT_S, Scenario, cure_in, group_of, placed, write
from tests.scenarios.streams import Sampler, Stream

LONGEST_ACT_S = 75.0
_LONGEST_PLAY_S = 1000.0
# More publishers than that come and go in no play.
_CHANGES = 20
# By then all is well again that was mended.
_HEALED_S = 40.0
_LATE_S = 1.5
_BOOTED_AT_S = 1_699_950_000
# What DDS takes to find a publisher and to drop one, and the relay to have subscribed; longer on a slow machine.
_LEAD_S = (-1.0, 3.0)


class Shown(NamedTuple):
    """A publisher of a topic, and from when to when the graph shows it."""

    topic: str
    endpoint: Endpoint
    begin: float
    end: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Moments:
    """When what happens in a play."""

    begins: float
    lengths: tuple[float, float, float]
    leads: tuple[float, ...]
    """How much earlier than its first message the graph shows the n-th publisher that comes."""
    drops: tuple[float, ...]
    """How much later than its last message the graph shows the n-th no more."""
    looks: tuple[float, ...]
    stops: tuple[tuple[float, float], ...]
    oversleeps: bool
    """Whether a look that is late shows as a standstill."""
    seed: int

    @property
    def acts(self) -> list[tuple[str, float, float]]:
        first = max(self.begins, 0.0)
        begins = [self.begins, first + self.lengths[0], first + sum(self.lengths[:2])]
        return [*zip("123", begins, [*begins[1:], begins[2] + self.lengths[2]], strict=True)]

    def with_acts(self, *, second: float | None = None, third: float) -> "Moments":
        """The same but for how long acts 2 and 3 take."""
        lengths = self.lengths[0], self.lengths[1] if second is None else second, third
        return replace(self, lengths=lengths)

    @property
    def is_smooth(self) -> bool:
        """Whether the relay always has its turn."""
        return not self.stops and all(two - one < _LATE_S for one, two in pairwise(self.looks))


def any_moments(seed: str) -> Moments:
    chance = random.Random(seed)
    lengths = [chance.choice([ACT_S, chance.uniform(ACT_S, LONGEST_ACT_S)]) for _ in "123"]
    leads = [chance.choice([0.1, chance.uniform(*_LEAD_S)]) for _ in range(_CHANGES)]
    drops = [chance.uniform(0, 1) for _ in range(_CHANGES)]
    stops = []
    for _ in range(chance.choice([0, 0, 1, 2])):
        begin = chance.uniform(0, 100)
        stops.append((begin, begin + chance.uniform(0.2, 3)))
    is_late = chance.random() < 0.5
    looks, at = [], chance.uniform(0.02, 1)
    while at < _LONGEST_PLAY_S:
        at = next((end + 0.001 for begin, end in stops if begin <= at <= end), at)
        looks.append(at)
        at += 1 + chance.uniform(0, 0.06)
        if is_late and chance.random() < 0.05:
            at += chance.uniform(1, 3)
    return Moments(
        begins=chance.uniform(-3, 5),
        lengths=(lengths[0], lengths[1], lengths[2]),
        leads=tuple(leads),
        drops=tuple(drops),
        looks=tuple(looks),
        stops=tuple(sorted(stops)),
        oversleeps=chance.random() < 0.5,
        seed=chance.randrange(10**6),
    )


class Play:
    """A scenario at its moments."""

    def __init__(self, name: str, scenario: Scenario, moments: Moments) -> None:
        self.name, self.scenario, self.moments = name, scenario, moments
        self.group = group_of(name, scenario)
        self.rows = {row["topic"]: row for row in self.group["topics"]}
        self.shown: list[Shown] = []
        self._sending: dict[Stream, list[tuple[float, float]]] = {}
        self._streams = placed(name, scenario.streams)
        self._follow_acts()

    def _follow_acts(self) -> None:
        since: dict[tuple[str, ...], tuple[float, float]] = {}
        n = 0
        for act, begin, end in self.moments.acts:
            active = [each for each in self._streams if act in each.acts]
            for key in sorted(since.keys() - {each.publisher for each in active}):
                self._end(key, since.pop(key)[0], begin + self.moments.drops[n])
                n += 1
            for each in active:
                if each.publisher not in since:
                    lead, first = self.moments.leads[n], max(0.0, begin) + 0.1
                    n += 1
                    since[each.publisher] = first + max(0.0, -lead), first + max(0.0, lead)
                spans = self._sending.setdefault(each, [])
                if spans and spans[-1][1] == begin:
                    spans[-1] = spans[-1][0], end
                else:
                    spans.append((max(begin, since[each.publisher][1]), end))
        for key, (found, _) in since.items():
            self._end(key, found, math.inf)

    def _end(self, key: tuple[str, ...], begin: float, end: float) -> None:
        driver, topic, type_name, reliability, _ = key
        is_unfit = self._is_unfit(topic, reliability)
        mismatch = Mismatch("reliability", "best_effort", "reliable") if is_unfit else None
        self.shown.append(Shown(topic, Endpoint(driver, type_name, mismatch), begin, end))

    def publishers(self, topic: str, second: float) -> tuple[Endpoint, ...]:
        return tuple(each.endpoint for each in self.shown if each.topic == topic and each.begin <= second < each.end)

    def sources(self) -> list[Source]:
        """A source for each stream that sends, or one that sends nothing."""
        found = []
        for row in self.group["topics"]:
            options = {key: value for key, value in row.items() if key != "topic"}
            streams = [each for each in self._streams if each.topic == row["topic"] and each.hz]
            messages: list[Callable[[], Iterable[tuple[float, int | None]]]]
            messages = [partial(self._messages, each) for each in streams] or [tuple]
            found += [Source(row["topic"], hz=1, messages=each, topic_options=options) for each in messages]
        return found

    def _messages(self, stream: Stream) -> Iterator[tuple[float, int | None]]:
        """Yield when each message of a stream is received, and its stamp."""
        spans, begins = self._sending.get(stream, []), self.moments.begins
        is_held = stream.durability == "transient_local"
        if self.rows[stream.topic]["type"] != stream.type or self._is_unfit(stream.topic, stream.reliability):
            return
        zero = BEGAN + round(begins * S) - (_BOOTED_AT_S * S if stream.clock == "boot" else 0)
        sampler, at = Sampler(stream, seed=self.moments.seed), begins
        while at < self.moments.acts[2][2]:
            sent, _, stamp = sampler.next()
            at = begins + sent
            ns = {"zero": 0, "none": None}.get(stream.clock, zero + round(stamp * S))
            if is_held:
                yield max(at, spans[0][0]), ns
            elif any(begin <= at < end for begin, end in spans):
                yield at, ns

    def _is_unfit(self, topic: str, reliability: str) -> bool:
        """Whether DDS does not connect a publisher to the group."""
        wanted = self.rows.get(topic, {}).get("qos", {})
        return isinstance(wanted, dict) and (wanted.get("reliability"), reliability) == ("reliable", "best_effort")

    def run(self) -> Told:
        until = self.moments.acts[2][2]
        looks = [at for at in self.moments.looks if at <= until]
        gaps = [(one, two) for one, two in pairwise(looks) if two - one > _LATE_S]

        def more(second: float) -> dict[str, Any]:
            late = [(one, two) for one, two in gaps if two <= second < two + 10] if self.moments.oversleeps else []
            if not late:
                return {}
            spans = [(one + 1, two) for one, two in late]
            spans += [(begin, end) for begin, end in self.moments.stops if end <= second < end + 10]
            return {"standstills": [Standstill(BEGAN + round(e * S), round((e - b) * S)) for b, e in spans]}

        return run(
            *self.sources(),
            seconds=math.ceil(until),
            seed=self.moments.seed,
            options={key: value for key, value in self.group.items() if key != "topics"},
            publishers=self.publishers,
            looks=looks,
            stops=self.moments.stops,
            facts=more,
        )

    def is_missing_at(self, second: float) -> bool:
        return any(not self.publishers(topic, second) for topic in self.rows)


class Played(NamedTuple):
    """What came of the acts, and what of act 3 with the cure where there is one."""

    play: Play
    told: Told
    cured: Play | None
    told_cured: Told | None


def played(name: str, scenario: Scenario, seed: int) -> Played:
    """Play three acts: the second until the cause was named, the third until all may be well, with the cure if any."""
    moments = any_moments(f"{name} {seed}")
    _, begins_2, _ = moments.acts[1]
    second = moments.lengths[1]
    if scenario.first:
        told = Play(name, scenario, moments.with_acts(second=LONGEST_ACT_S, third=0)).run()
        named = next((line.second for line in told.warnings if line.code == scenario.first), 0.0)
        second = max(second, named - begins_2 + 0.3)
    if not scenario.cure:
        play = Play(name, scenario, moments.with_acts(second=second, third=_HEALED_S))
        return Played(play, play.run(), None, None)
    play = Play(name, scenario, moments.with_acts(second=second, third=0))
    told = play.run()
    cured = _cured(play, told, any_moments(f"{name} {seed} cured"))
    return Played(play, told, cured, cured.run())


def _cured(broken: Play, told: Told, moments: Moments) -> Play:
    """A group that begins anew with what it was told to write, among sensors that have long been there."""
    name, scenario = broken.name, broken.scenario
    text = next((line.text for line in told.warnings if line.code == scenario.first), "")
    about = next((each.input for _, each in told.findings(scenario.first) if each.input is not None), 0)
    changes = cure_in(text, broken.group["topics"][about]["topic"], scenario)
    ago = broken.moments.acts[1][2] - broken.moments.begins
    moments = replace(moments, begins=-ago, lengths=(LONGEST_ACT_S, 0, 0), leads=(0.0,) * _CHANGES)
    streams = [replace(each, acts="1") for each in scenario.streams if "3" in each.acts]
    play = Play(name, replace(scenario, streams=streams), moments)
    write(play.group, changes)
    play.shown = [each._replace(endpoint=replace(each.endpoint, mismatch=None), begin=0) for each in play.shown]
    return play
