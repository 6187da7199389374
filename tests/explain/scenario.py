"""A rig in virtual time: made-up arrivals through the real engine, watched, judged and logged once a second.

    told = run(Source("/camera", hz=30), Source("/lidar", hz=10), seconds=60, options={"slop": "20ms"})
    assert told.warnings == []

Seconds are those after the start; a source's message of second 1 has the stamp BEGAN + 1 s by the machine's clock.
"""

import random
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from heapq import merge
from operator import itemgetter
from typing import Any, TypedDict

import yaml

from syncrelay.config import GroupConfig, load_text
from syncrelay.explain import (
    Endpoint,
    EngineDriver,
    Finding,
    FindingLog,
    GroupFacts,
    GroupWatch,
    InputGraph,
    Judge,
    Pause,
    Severity,
    Standstill,
)
from syncrelay.explain.finding_log import Remark
from syncrelay.explain.trials import Trials
from syncrelay.relay.types import SettlingType
from syncrelay.sync import DropReason, Match, Message, Outcome

S = 1_000_000_000
MS = 1_000_000
BEGAN = 1_700_000_000 * S
IMU = "sensor_msgs/msg/Imu"


def always(_second: float) -> bool:
    return True


def nothing(_second: float) -> float:
    return 0.0


@dataclass(frozen=True, kw_only=True)
class _SourceFaults:
    """What may be wrong, or odd, with a source; functions are of the true second after the start.

    `clock` is by how many seconds its stamps are ahead of the machine's clock; `stamp` makes the whole stamp, in
    nanoseconds, from the one that there would be. `sends` says whether a message is sent at all, `hz_at` its rate.
    `received` is when a message arrives that would arrive at that second: later where something holds it up. In place
    of all that, `messages` gives when each is received, in seconds, and its stamp; None of one that is cut short.
    """

    clock: Callable[[float], float] = nothing
    stamp: Callable[[int], int | None] | None = None
    sends: Callable[[float], bool] = always
    hz_at: Callable[[float], float] | None = None
    received: Callable[[float], float] | None = None
    messages: Callable[[], Iterable[tuple[float, int | None]]] | None = None


@dataclass(frozen=True)
class Source(_SourceFaults):
    """A publisher. `delay_ms` is from stamp to receipt; both jitters are standard deviations.

    Two sources of one topic are two publishers of it.
    """

    topic: str
    hz: float
    delay_ms: float = 5.0
    jitter_ms: float = 0.0
    delay_jitter_ms: float = 0.0
    phase_ms: float = 0.0
    node: str = ""
    required: bool = True
    topic_options: dict[str, Any] = field(default_factory=dict)

    @property
    def endpoint(self) -> Endpoint:
        return Endpoint(self.node or f"{self.topic}_driver", IMU)


class Noise(TypedDict):
    """What a real source has of both jitters, as keywords of `Source`."""

    jitter_ms: float
    delay_jitter_ms: float


@dataclass(frozen=True)
class Line:
    """A line of the log: at which second, whether it warns, and of which finding about which topics."""

    second: float
    warns: bool
    text: str
    code: str | None
    topics: frozenset[str]


@dataclass(frozen=True)
class Told:
    """What was said: `lines` of the log, and at each second what was found, what is well left out."""

    lines: list[Line]
    found: list[tuple[float, tuple[Finding, ...]]]
    facts: GroupFacts

    @property
    def warnings(self) -> list[Line]:
        return [line for line in self.lines if line.warns]

    @property
    def first(self) -> Line:
        """The first warning."""
        return self.warnings[0]

    @property
    def codes(self) -> set[str]:
        """The codes of all warnings that the log ever had."""
        return {str(line.code) for line in self.warnings}

    @property
    def ever_found(self) -> set[str]:
        """The codes of all that was ever found to be wrong, whether it lasted or not."""
        return {each.code.value for _, found in self.found for each in found if each.severity is not Severity.OK}

    def says_only(self, code: str, *topics: str) -> bool:
        """Whether the log warns of one cause alone, at first about these topics; of the group where there are none."""
        return self.codes == {code} and self.first.topics == set(topics)

    def findings(self, code: str) -> list[tuple[float, Finding]]:
        """All findings of one code, with their seconds."""
        return [(second, each) for second, found in self.found for each in found if each.code.value == code]


def run(
    *sources: Source,
    seconds: int,
    seed: int = 0,
    options: dict[str, Any] | None = None,
    stops: Sequence[tuple[float, float]] = (),
    sleeps: Sequence[tuple[int, int]] = (),
    paused: Sequence[tuple[float, float]] = (),
    publishers: Callable[[str, float], tuple[Endpoint, ...]] | None = None,
    facts: Callable[[float], dict[str, Any]] | None = None,
    looks: Sequence[float] | None = None,
    rest_s: float = 0.0,
    hears: Callable[[float, GroupFacts, tuple[Finding, ...], list[Remark]], None] | None = None,
    whole: Callable[[], Trials] | None = None,
) -> Told:
    """Run a rig for so many seconds, and look at it at each, or at those that are given.

    `stops` are when the whole process stands still, as by SIGSTOP, each from one second to another: what comes
    meanwhile is received at the end, and who looks rests for `rest_s` more, as a rest goes on behind it. `sleeps` is
    when nobody listens to a lazy group: it receives nothing. `paused` is when the relay is paused.

    `publishers` gives what the graph shows of a topic at a second, `facts` more keywords of `GroupWatch.facts`.
    `hears` is called at each look with what the group's log would say, and of what. `whole` gives trials on all
    messages, where values are suggested as of a recording.
    """
    config = group_of(sources, options or {})
    names = [topic.topic for topic in config.topics]
    arrivals = merge(
        *(_arrivals(each, names, seconds, _chance(seed, place, each)) for place, each in enumerate(sources)),
        key=itemgetter(0, 1),
    )
    relay = _Relay(config, paused, hears, whole)
    heard = (each for each in arrivals if _until(sleeps, each[0]) == each[0])
    # Of what comes at once on a topic, one may have no stamp that could be compared.
    waiting = sorted(((_until(stops, at), index, stamp) for at, index, stamp in heard), key=itemgetter(0, 1))
    for index in (index for index, topic in enumerate(config.topics) if topic.stamp == "receive"):
        waiting = _stamped_by_receipt(waiting, index)
    place = 0
    shown = publishers or (lambda topic, _: tuple(each.endpoint for each in sources if each.topic == topic))
    before = 0.0
    for second in looks or range(1, seconds + 1):
        if _until([(begin, end + rest_s) for begin, end in stops], float(second)) > second:
            continue
        while place < len(waiting) and waiting[place][0] <= second:
            at, index, stamp = waiting[place]
            relay.take(index, stamp, _ns(at))
            place += 1
        stop = next(((begin, end) for begin, end in stops if before <= end + rest_s <= second), None)
        before = second
        relay.asleep = _until(sleeps, second) > second
        relay.woke = max((_ns(end) for _, end in sleeps if end <= second), default=None)
        standstill = stop and Standstill(_ns(stop[1] + rest_s), round((stop[1] - stop[0]) * S), round(rest_s * S))
        relay.poll(
            second, [shown(name, float(second)) for name in names], standstill, (facts or (lambda _: {}))(second)
        )
    assert relay.facts is not None
    return Told(relay.lines, relay.found, relay.facts)


def group_of(sources: Sequence[Source], options: dict[str, Any]) -> GroupConfig:
    """Return the group of a file that has a topic for each source."""
    keys = {each.topic: {"topic": each.topic, "type": IMU, **each.topic_options} for each in sources}
    topics = {name: {key: value for key, value in of.items() if value is not None} for name, of in keys.items()}
    for each in sources:
        if not each.required:
            topics[each.topic]["required"] = False
    group = {"policy": "approximate_time", "topics": list(topics.values()), **options}
    return load_text(yaml.safe_dump({"version": 1, "groups": {"front": group}}), environ={}).groups[0]


def _chance(seed: int, place: int, source: Source) -> random.Random:
    """Return what a source's jitter comes from: the same in each process, which a function's name is not."""
    return random.Random(f"{seed} {place} {source.topic} {source.hz} {source.node}")


def _ns(second: float) -> int:
    return BEGAN + round(second * S)


def _stamped_by_receipt(
    waiting: Sequence[tuple[float, int, int | None]], index: int
) -> list[tuple[float, int, int | None]]:
    """Return messages of which those of one input have the time of their receipt for a stamp: no two the same."""
    number, found = 0, []
    for at, each, stamp in waiting:
        number += each == index
        found.append((at, each, _ns(at) + number if each == index else stamp))
    return found


def _until(stops: Sequence[tuple[float, float]], at: float) -> float:
    return next((end for begin, end in stops if begin <= at < end), at)


def _arrivals(
    source: Source, names: Sequence[str], seconds: int, chance: random.Random
) -> Iterator[tuple[float, int, int | None]]:
    """Yield when each message is received, its input and its stamp, in the order of receipt."""
    index = names.index(source.topic)
    if source.messages is not None:
        yield from ((at, index, stamp) for at, stamp in source.messages())
        return
    second, last = source.phase_ms / 1000, 0.0
    while second < seconds:
        if source.sends(second):
            measured = second + chance.gauss(0, source.jitter_ms / 1000)
            stamp: int | None = _ns(measured + source.clock(second))
            delay = max(0.0002, source.delay_ms / 1000 + chance.gauss(0, source.delay_jitter_ms / 1000))
            at = measured + delay
            last = max(last, at if source.received is None else source.received(at))
            yield last, index, stamp if source.stamp is None or stamp is None else source.stamp(stamp)
        second += 1 / (source.hz if source.hz_at is None else source.hz_at(second))


class _Relay:
    """What the running relay does with a group, but for DDS."""

    def __init__(
        self,
        config: GroupConfig,
        paused: Sequence[tuple[float, float]],
        hears: Callable[[float, GroupFacts, tuple[Finding, ...], list[Remark]], None] | None,
        whole: Callable[[], Trials] | None,
    ) -> None:
        self._hears = hears
        self._pauses = [(_ns(begin), _ns(end)) for begin, end in paused]
        self._n_inputs = len(config.topics)
        self._names = [(topic.topic, topic.output) for topic in config.topics]
        self._settling = [SettlingType() if topic.type is None else None for topic in config.topics]
        self._taken: list[Endpoint | None] = [None] * len(config.topics)
        self._driver = EngineDriver(config, self._leave)
        self._clocks = [topic.device_clock() for topic in config.topics]
        self._watch = GroupWatch(config, began=BEGAN, whole=whole)
        self._judge = Judge()
        self._log = FindingLog()
        self._arrived: tuple[list[tuple[int, int]], ...] = tuple([] for _ in config.topics)
        self._sent: list[tuple[tuple[int | None, ...], int]] = []
        self._standstills: list[Standstill | None] = []
        self.asleep = False
        self.woke: int | None = None
        self.lines: list[Line] = []
        self.found: list[tuple[float, tuple[Finding, ...]]] = []
        self.facts: GroupFacts | None = None

    def take(self, index: int, stamp: int | None, now: int) -> None:
        """Take one message."""
        if stamp is None:
            self._driver.reject(index, now, now=now)
            return
        if (clock := self._clocks[index]) is not None:
            stamp = clock.host_time(stamp, now)
        self._arrived[index].append((stamp, now))
        message = Message(index, stamp, now)
        if self._pause_at(now) is None:
            self._driver.add(message, now=now)
            return
        self._driver.engine.let_go(DropReason.PAUSED)
        self._driver.engine.reject(message, DropReason.PAUSED)

    def _pause_at(self, now: int) -> Pause | None:
        begins = (begin for begin, end in self._pauses if begin <= now < end)
        return next((Pause(begin, "/syncrelay/resume") for begin in begins), None)

    def _leave(self, outcomes: Sequence[Outcome], now: int) -> None:
        for each in outcomes:
            if isinstance(each, Match):
                complete = max(message.payload for message in each.messages if message is not None)
                self._sent.append((each.stamps, now - complete))

    def poll(
        self,
        second: float,
        publishers: Sequence[tuple[Endpoint, ...]],
        standstill: Standstill | None,
        more: dict[str, Any],
    ) -> None:
        """Poll as the monitor does, and write what the log is told."""
        now = _ns(second)
        self._driver.expire(now)
        if self.asleep:
            self._driver.engine.flush(DropReason.SHUTDOWN)
        self._standstills = [*self._standstills[-9:], standstill]
        engine = self._driver.engine
        self._watch.add(self._arrived, self._sent, engine.counts(), engine.sets, woke=self.woke, now=now)
        self._arrived, self._sent = tuple([] for _ in range(self._n_inputs)), []
        for index, settling in enumerate(self._settling):
            if settling is not None and self._taken[index] is None:
                self._taken[index] = settling.publisher(publishers[index], now=float(second))
        graph = [
            InputGraph(*name, publishers=each, type_from=taken)
            for name, each, taken in zip(self._names, publishers, self._taken, strict=True)
        ]
        self.facts = self._watch.facts(
            graph,
            now=now,
            **{
                "standstills": [each for each in self._standstills if each],
                "asleep": self.asleep,
                "pause": self._pause_at(now),
                **more,
            },
        )
        found = self._judge.judge(self.facts)
        assert not any("None" in f"{each.text} {each.suggestion or ''}" for each in found)
        self.found.append((second, found))
        remarks = [*self._log.remarks(self.facts, found, self._judge.explained(self.facts))]
        if self._hears is not None:
            self._hears(second, self.facts, found, remarks)
        for remark in remarks:
            code = remark.code and remark.code.value
            about = [index for finding in remark.findings[:1] for index in finding.about]
            topics = frozenset(self.facts.inputs[index].name for index in about)
            self.lines.append(Line(second, remark.severity is not Severity.OK, remark.text, code, topics))
