"""Draws a rig and its faults by a seed, plays it in virtual time, and compares what was said with what is true."""

import contextlib
import random
import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from itertools import count
from typing import Any, Final, NamedTuple

import numpy as np

from syncrelay.config import ConfigError, GroupConfig
from syncrelay.explain import Code, EngineDriver, Finding, GroupFacts, Severity, explanation, with_ok
from syncrelay.explain.finding_log import Remark
from syncrelay.sync import Match, Message
from tests.bank.kinds import KINDS, Kind, Truth
from tests.bank.rig import LONGEST_S, Flow, Rig, S, a_rig, spans, without_what_was_before_the_start
from tests.explain.scenario import BEGAN, Source, group_of, run

IN_TIME_S: Final = 7.0
MIDWAY_S: Final = (6.0, 16.0)
_GRACE_S: Final = 15.0
_SIZE: Final = 0.2
_HEALTHY_S: Final = 60.0
_ATTEMPTS: Final = 100
# A standstill of the relay is truly told, for as long as it is seen.
_STALL_TOLD_S: Final = 12.0
_NOT_YET: Final = "not known yet"
# Kinds of findings that say how far a clock is off.
_CLOCKS: Final = frozenset({"other_clock", "several_publishers"})
# What is only known once a size is: a time scale is told by how far off it is.
_BY_SIZE: Final = frozenset({"size", "words"})
_FIGURE: Final = re.compile(r"(\d+(?:\.\d+)?) ?(ns|us|ms|s|min|h|days|years|ppm|Hz|times|%)(?![\w/])")
_OF: Final = re.compile(r"(\d+) of (?:the last )?(\d+)")
_NS: Final = {
    "ns": 1,
    "us": 1e3,
    "ms": 1e6,
    "s": 1e9,
    "min": 60e9,
    "h": 3600e9,
    "days": 86400e9,
    "years": 365.2425 * 86400e9,
}
_OFFER: Final = re.compile(r"`(?P<key>\w+): (?P<value>[^`]+)`(?: at (?P<topic>/\w+))?")


class Score(Enum):
    """How well the first sentence fits; of a rig without a fault, nothing is what it should be."""

    TOLD = "told"
    LATE = "late"
    HALF = "half"
    OTHER = "other"
    NOTHING = "nothing"


@dataclass
class Drawn:
    """A rig with its faults."""

    seed: int
    kinds: tuple[str, ...]
    rig: Rig
    truths: tuple[Truth, ...]
    seconds: float
    looks: list[float]
    well: Rig
    """The rig as it was before its faults."""
    alone: tuple["Alone", ...] = ()
    """Of several faults, each as it is without the others."""

    @property
    def sources(self) -> list[Source]:
        return [
            Source(
                each.topic,
                each.hz,
                node=each.endpoint.node,
                required=each.required,
                messages=each.messages,
                topic_options=each.options,
            )
            for each in self.rig.flows
        ]

    @property
    def config(self) -> GroupConfig:
        return group_of(self.sources, self.rig.options)


class Alone(NamedTuple):
    """A rig with one of several faults, and what is true of it."""

    rig: Rig
    truth: Truth


@dataclass
class Result:
    """What came of a draw: `first` is the first sentence that is neither well nor of what else is true of the rig."""

    drawn: Drawn
    score: Score = Score.NOTHING
    why: str = ""
    first: tuple[float, Finding] | None = None
    said: list[tuple[float, str]] = field(default_factory=list)
    lasted: float = 0.0
    """For how many seconds there was a warning, of a rig without a fault."""
    cure: str | None = None
    """What is wrong with what was suggested."""
    logged: float | None = None

    def hears(self, second: float, shown: Finding, *, is_open: bool = False) -> bool:
        """Take what explains most at a second, and return whether it can be judged.

        It is open while what it suggests is still to be tried.
        """
        draw, text = self.drawn, _sentence(shown)
        if not self.said or self.said[-1][1] != text:
            self.said.append((second, text))
        if shown.severity is Severity.OK or shown.code is Code.STARTING or is_of_rig(draw, shown, second):
            return False
        self.lasted += 1.03
        self.first = self.first or (second, shown)
        # A finding may say itself that more will be known soon.
        if not draw.truths or is_open or _NOT_YET in text:
            return False
        self.first = second, shown
        # What has only just begun may be less than it will be.
        early = [fit(draw, truth, second, shown) for truth in draw.truths if second < truth.seen]
        return (Score.TOLD, "") in early or not any(score is Score.HALF and why in _BY_SIZE for score, why in early)

    @property
    def is_told(self) -> bool:
        """Whether the first sentence names the fault, in time or late."""
        return self.score in (Score.TOLD, Score.LATE)

    def judge(self) -> Truth | None:
        """Score the first sentence, and return the truth that it fits best."""
        truths = self.drawn.truths
        if not truths:
            self.score = Score.OTHER if self.first else Score.TOLD
        if not truths or self.first is None:
            return None
        scores = [fit(self.drawn, truth, *self.first) for truth in truths]
        self.score, self.why = min(scores, key=lambda each: list(Score).index(each[0]))
        return truths[scores.index((self.score, self.why))]


def drawn(
    seed: int, kinds: Sequence[str], n_faults: int, *, midway: tuple[float, float] = MIDWAY_S, began: int = BEGAN
) -> Drawn:
    """Draw what a seed gives.

    A fault that begins while the relay runs does so between the seconds `midway`, later where messages are rare.
    `began` is second 0 by the machine's clock.
    """
    chance = random.Random(f"bank {seed} {n_faults}")
    if not n_faults:
        rig = a_rig(
            chance,
            chance.choice(["approximate_time", "approximate_time_eager", "exact_time", "latest_time"]),
            seconds=_HEALTHY_S,
            began=began,
        )
        _stall(rig)
        without_what_was_before_the_start(rig)
        return Drawn(seed, (), rig, (), _HEALTHY_S, _looks(chance, _HEALTHY_S), rig)
    for attempt in count():
        if not attempt % _ATTEMPTS:
            # Some kinds do not go together.
            names = tuple(chance.sample(list(kinds), min(n_faults, len(kinds))))
        found = _faulty(chance, [KINDS[each] for each in names], midway, began)
        if found is not None:
            rig, well, truths, alone = found
            break
    if "stalls" not in names:
        _stall(rig)
    if "all_held" in names:
        # While the relay stands still, nobody sees what the network does.
        held = truths[names.index("all_held")]
        rig.stops = [each for each in rig.stops if each[1] < held.seen - held.sizes[0] / S or each[0] > held.seen]
    late = sum(end - begin for begin, end in rig.stops)
    truths = tuple(replace(each, seen=each.seen + late) for each in truths)
    alone = tuple(each._replace(truth=replace(each.truth, seen=each.truth.seen + late)) for each in alone)
    seconds = max(each.seen for each in truths) + IN_TIME_S + _GRACE_S
    return Drawn(seed, names, rig, truths, seconds, _looks(chance, seconds), well, alone)


class _Faulty(NamedTuple):
    """A rig with faults, the rig without them, what is true, and where there are several, each fault alone."""

    rig: Rig
    well: Rig
    truths: tuple[Truth, ...]
    alone: tuple[Alone, ...]


def _faulty(chance: random.Random, kinds: list[Kind], midway: tuple[float, float], began: int) -> _Faulty | None:
    """Return a rig with these faults; None where one does no harm, or is not what it would be without the others."""
    policies = [each for each in kinds[0].policies if all(each in of.policies for of in kinds)]
    if not policies:
        return None
    policy = chance.choice(policies)
    well = a_rig(chance, policy, same_rate=any(each.same_rate for each in kinds), began=began)
    begins, seeds = [], []
    for kind in kinds:
        first, last = midway
        is_midway = chance.random() < kind.midway
        at = well.starts + first + (last - first) * chance.random() + 8 * well.slowest / S
        begins.append(at if is_midway else 0.0)
        seeds.append(chance.randrange(2**32))
    rig, truths, alone = _copy(well), [], []
    for draw in zip(kinds, begins, seeds, strict=True):
        # Of what does not come, nothing else can be seen.
        truth = _put_in(rig, *draw) if all(len(each.true) for each in rig.flows) else None
        if truth is None or truth.seen + IN_TIME_S > LONGEST_S - 5:
            return None
        truths.append(truth)
        if len(kinds) > 1:
            one = _copy(well)
            is_true = _put_in(one, *draw)
            # Of one clock that is off by two causes, what is seen is their sum.
            if any(
                _CLOCKS & each.codes and _CLOCKS & truth.codes and each.topics & truth.topics for each in truths[:-1]
            ):
                return None
            if is_true is None or (is_true.codes, is_true.topics) != (truth.codes, truth.topics):
                return None
            if any(one.options[key] not in (well.options[key], rig.options[key]) for key in well.options):
                return None
            alone.append(Alone(one, is_true))
    for each in (rig, well, *(one.rig for one in alone)):
        without_what_was_before_the_start(each)
    return _Faulty(rig, well, tuple(truths), tuple(alone))


def _copy(rig: Rig) -> Rig:
    return replace(rig, flows=[replace(each) for each in rig.flows], options=dict(rig.options), stops=[*rig.stops])


def _put_in(rig: Rig, kind: Kind, begin: float, seed: int) -> Truth | None:
    """Change a rig by a fault, by chances of its own; what is there from the start shows once all sensors have."""
    rig.begin, rig.chance = begin, random.Random(seed)
    truth = kind.draw(rig)
    return truth if truth is None or begin else replace(truth, seen=truth.seen + rig.starts)


def _stall(rig: Rig) -> None:
    chance = rig.chance
    if chance.random() < 0.15:
        begin = chance.uniform(1, 20)
        rig.stops.append((begin, begin + chance.uniform(0.1, 1.5)))


def _looks(chance: random.Random, seconds: float) -> list[float]:
    at, looks = chance.uniform(0.02, 1), []
    while at < seconds:
        looks.append(at)
        at += 1 + chance.uniform(0, 0.06)
    return looks


class _HeardEnoughError(Exception):
    pass


def play(draw: Drawn) -> Result:
    """Play a draw until its first sentence, or to its end."""
    result = heard(draw, lambda facts, found: explanation(with_ok(facts, found)))
    truth = result.judge()
    if result.first is not None and result.is_told and truth is not None and truth.moments:
        result.cure = _wrong_with_cure(draw, result.first[1])
    return result


def heard(draw: Drawn, chosen: Callable[[GroupFacts, tuple[Finding, ...]], Finding | None]) -> Result:
    """Play a draw until the first sentence that can be judged, of those that are `chosen` at each look."""
    result = Result(draw)

    def hears(second: float, facts: GroupFacts, found: tuple[Finding, ...], remarks: list[Remark]) -> None:
        if result.logged is None and any(each.severity is not Severity.OK for each in remarks):
            result.logged = second
        shown = chosen(facts, found)
        if shown is None:
            return
        awaits = facts.suggester is not None and facts.suggester.awaits((shown.code, shown.input))
        if result.hears(second, shown, is_open=awaits):
            raise _HeardEnoughError

    with contextlib.suppress(_HeardEnoughError):
        run(
            *draw.sources,
            seconds=int(draw.seconds) + 1,
            options=draw.rig.options,
            stops=draw.rig.stops,
            publishers=publishers_of(draw.rig.flows),
            looks=draw.looks,
            hears=hears,
        )
    return result


def publishers_of(flows: Sequence[Flow]):
    by_topic = defaultdict(list)
    for each in flows:
        by_topic[each.topic].append(each)
    return lambda topic, second: tuple(each.endpoint for each in by_topic[topic] if each.is_shown(second))


def is_of_rig(draw: Drawn, finding: Finding, second: float) -> bool:
    """Whether a finding is of what is true of a rig beside its faults: that sensors are still to start, or a stall."""
    topics = [topic.topic for topic in draw.config.topics]
    if finding.code is Code.NO_PUBLISHER:
        # The graph is looked at once a second.
        late = {each.topic for each in draw.rig.flows if second < max(each.starts, each.found) + 1.1}
        return {topics[index] for index in finding.about} <= late
    return is_of_stall(draw, finding, second)


def is_of_stall(draw: Drawn, finding: Finding, second: float) -> bool:
    if finding.code is not Code.TOO_SLOW or "stalls" in draw.kinds:
        return False
    return any(end - begin > 0.4 and begin <= second < end + _STALL_TOLD_S for begin, end in draw.rig.stops)


def _sentence(finding: Finding) -> str:
    return f"{finding.code.value}: {finding.text}" + (f"; {finding.suggestion}" if finding.suggestion else "")


def fit(draw: Drawn, truth: Truth, second: float, finding: Finding) -> tuple[Score, str]:
    topics = [topic.topic for topic in draw.config.topics]
    if finding.code.value not in truth.codes:
        return Score.OTHER, finding.code.value
    about = {topics[index] for index in finding.about} or set(re.findall(r"/\w+", _sentence(finding)))
    text = _sentence(finding)
    # Of two inputs that do not fit, neither is the one.
    is_pair = not about and len(topics) == 2 and finding.code is Code.OVER_SLOP
    if truth.topics and not about & truth.topics and not is_pair:
        return Score.HALF, "input"
    if truth.sizes and not any(_is_near(each, size) for each in _figures(text, truth.unit) for size in truth.sizes):
        return Score.HALF, "size"
    if truth.says and not any(word in text for word in truth.says):
        return Score.HALF, "words"
    return (Score.TOLD, "") if second <= truth.seen + IN_TIME_S else (Score.LATE, f"{second - truth.seen:.0f} s")


def _is_near(one: float, other: float) -> bool:
    return abs(one - other) <= _SIZE * abs(other) + 1e-12


def _figures(text: str, unit: str) -> list[float]:
    if unit == "share":
        shares = [int(one) / max(1, int(all_)) for one, all_ in _OF.findall(text)]
        shares += [float(number) / 100 for number, of in _FIGURE.findall(text) if of == "%"]
        return [each for one in shares for each in (one, 1 - one)]
    found = ((float(number), of) for number, of in _FIGURE.findall(text))
    return [
        number * _NS[of] if unit == "ns" else number
        for number, of in found
        if (of in _NS if unit == "ns" else of == unit)
    ]


def _wrong_with_cure(draw: Drawn, finding: Finding) -> str | None:
    """Say what is wrong with the group, had it what was suggested; None if all is well.

    What is off by seconds may be of another clock or take that long: it says what to write in either case.
    """
    offers = [each for each in re.split(r", or,? |; ", finding.suggestion or "") if _OFFER.search(each)] or [""]
    tried = [_wrong_with(draw, each) for each in (offers if finding.code is Code.OTHER_CLOCK else offers[:1])]
    return None if None in tried else tried[-1]


def _wrong_with(draw: Drawn, text: str) -> str | None:
    offers = list(_OFFER.finditer(text))
    if not offers:
        return "nothing offered"
    group: dict[str, Any] = {}
    topics: dict[str, dict[str, Any]] = defaultdict(dict)
    topic = None
    for each in reversed(offers):
        value: Any = int(each["value"]) if each["value"].isdecimal() else each["value"]
        topic = each["topic"] or topic
        if topic and each["key"] in ("offset", "stamp", "clock", "delay"):
            topics[topic][each["key"]] = value
        else:
            group[each["key"]] = value
    sources = [replace(each, topic_options={**each.topic_options, **topics[each.topic]}) for each in draw.sources]
    options = {**draw.rig.options, **group}
    if "policy" in group:
        options = {key: value for key, value in options.items() if key in ("policy", "queue_size", "slop", "max_wait")}
    try:
        config = group_of(sources, options)
    except ConfigError as error:
        return f"not a valid file: {error}"
    # What is offered for what a clock does now is not for what it did before.
    sets = list(sets_of(draw, config, since=draw.rig.begin))
    flows = [replace(each, true=each.true[each.since(draw.rig.begin)]) for each in draw.rig.flows]
    possible = len(spans(draw.rig, flows, by=lambda each: each.true))
    # By the truth, what was measured together lies as near as it did in the rig that was well.
    most = max(draw.rig.slop, draw.rig.width)
    right = sum(span <= 1.05 * most for span in sets)
    if len(sets) < 0.9 * possible:
        return f"{len(sets)} of {possible} sets"
    return None if right >= 0.98 * len(sets) else f"{right} of {len(sets)} sets are of one moment"


def sets_of(draw: Drawn, config: GroupConfig, since: float = 0.0, until: float = LONGEST_S) -> Iterator[int]:
    """Give the true span of each set of samples taken since then, of the messages that come until then."""
    index_of = {topic.topic: index for index, topic in enumerate(config.topics)}
    came = [
        (int(at), index_of[each.topic], int(stamp), int(true))
        for each in draw.rig.flows
        for at, stamp, true in zip(each.received, each.stamps, each.true, strict=True)
        if at <= until * S
    ]
    given: list[int] = []

    def take(outcomes, _now) -> None:
        for each in outcomes:
            if isinstance(each, Match):
                true = [message.payload for message in each.messages if message is not None]
                if min(true) >= since * S:
                    given.append(max(true) - min(true))

    driver = EngineDriver(config, take)
    clocks = [topic.device_clock() for topic in config.topics]
    for at, index, stamp, true in sorted(came):
        clock, now = clocks[index], draw.rig.began + at
        by_header = stamp if clock is None else clock.host_time(stamp, now)
        driver.add(Message(index, now if config.topics[index].stamp == "receive" else by_header, true), now=now)
    driver.finish(draw.rig.began + round(min(until, draw.seconds) * S))
    yield from given


def _started(flow: Flow) -> str:
    return f", starts at {flow.starts:.2f} s and is shown from {flow.found:.2f} s on" if flow.starts else ""


def described(draw: Drawn) -> str:
    """Say what a draw is."""
    lines = [f"seed {draw.seed}: {' and '.join(draw.kinds) or 'well'}, from {draw.rig.begin:.1f} s; {draw.rig.options}"]
    lines += [f"  the relay stands still from {begin:.1f} to {end:.1f} s" for begin, end in draw.rig.stops]
    for each in draw.rig.flows:
        first = ", ".join(f"{(stamp - draw.rig.began) / S:.6f}" for stamp in each.stamps[:3])
        lines.append(
            f"  {each.topic} at {each.hz:.3g} Hz, {each.lateness / 1e6:.3g} ms late, jitter {each.jitter / 1e6:.3g} ms"
            f"{'' if each.required else ', optional'}{_started(each)};"
            f" stamps {first} ... at {np.round(each.true[:1] / S, 6)}"
        )
    lines += [f"  true: {each}" for each in draw.truths]
    return "\n".join(lines)
