"""What must hold in every world, judged by what the world knows and not by what the relay says of itself."""

import logging
import re
from bisect import bisect_left
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil
from typing import TYPE_CHECKING, Final, NamedTuple

from syncrelay.explain import explanation
from syncrelay.explain.codes import MATCHING, Code
from syncrelay.explain.graph_facts import serving
from syncrelay.status import Phase
from tests.simulated.bus import Reader, Sample, Writer
from tests.simulated.faults import KINDS, concerns, is_felt
from tests.simulated.plan import HEALED_S, NAMED_S, SETTLED_S, TYPE, Group, Plan, Step
from tests.simulated.scheduler import SECOND
from tests.simulated.world import RelayProcess, World, identity

if TYPE_CHECKING:
    from syncrelay.dataflow.group import GroupRelay
    from syncrelay.explain import GroupReport, InputGraph
    from syncrelay.relay.relay import Relay

# After what is odd, so long; sets may be missing so long before a fault began.
_AGAIN_S: Final = 15.0
_BEFORE_S: Final = 2.5
# A set may take so long beside what its policy waits for.
_LATE_S: Final = 1.5
_ANSWERED_S: Final = 15.0
# A group is judged every second or so, an input that is served has this long to send, and a node's name comes by then.
_JUDGED_S: Final = 12.0
_ABOUT_TO_SEND_S: Final = 4.5
_HERE_S: Final = 8.0
_NAMED_BY_S: Final = 45.0
# The phase is shown by then.
_SHOWN_BY_S: Final = 5.0
_PAUSES: Final = ("pause", "resume")
# What DDS refuses on a topic is asked for again no more often than this, in so long, and by each reload.
_TRIES: Final = 12
_TRIED_S: Final = 10.0
# A lazy group sleeps so long after the last of those who listen has left.
_ASLEEP_S: Final = 8.0
# What is said of a group's sets is held against those of so long, if it was looked at all the while.
_SHOWN_S: Final = 25.0
_LOOKS_S: Final = 3.0
# So many messages a publisher keeps at most.
_KEPT: Final = 100
_SETS_ARE_MISSING: Final = frozenset({"few_sets", "over_slop", "unexplained"})
_SILENT_FOR: Final = re.compile(r"(/\w+) has been silent for ([\d.]+) s|without (/\w+).*silent for ([\d.]+) s")
# What findings about an input say of those who publish it.
_IN_GRAPH: Final["Mapping[Code, Callable[[InputGraph], bool]]"] = {
    Code.NO_PUBLISHER: lambda graph: not graph.publishers,
    Code.OTHER_TYPE: lambda graph: any(each.type != TYPE for each in graph.publishers),
    Code.INCOMPATIBLE_QOS: lambda graph: any(each.mismatch for each in graph.publishers),
}
_QUIET: Final = frozenset({"healthy", "starting", "nobody_listens"})
# Messages are of no known moment, or cannot leave.
_ODD: Final = frozenset({"doubles", "refuse_messages", "second_publisher", "stamps_early", "other_clock", "unstamped"})
# Messages come that make no set.
_BETWEEN: Final = frozenset({"doubles", "second_publisher"})
_SUBSCRIBES_AGAIN: Final = frozenset(
    {
        "best_effort",
        "configure_again",
        "deactivate",
        "nobody_listens",
        "refuse_subscriptions",
        "reload_changed",
        "reload_refused",
        "reload_without",
        "restarts",
    }
)
# Groups are made by then, and anew by these.
_MADE_BY_S: Final = 10.0
_MADE_ANEW: Final = frozenset({"configure_again", "reload_without"})
_RETURNS: Final = frozenset({"dies", "dies_in_write", "leaves", "other_type", "restarts"})
# Before its messages have come for a while, nothing is known of a group but what the graph shows.
_AT_FIRST: Final = frozenset(
    {
        "no_publisher",
        "silent",
        "alone",
        "no_clock",
        "inactive",
        "waiting_for_optional",
        "few_sets",
        "short_queue",
        "bursts",
    }
)
# Their ends are like their begins: the driver ends, and returns at once.
_RETURN_TWICE: Final = frozenset({"best_effort", "other_type"})
# So long the relay remembers the paces of an input.
_PACES_S: Final = 120.0
# Moments are multiples of periods, which are whole nanoseconds.
_ROUNDED: Final = 1_000_000
# Ticks come late, or all at once.
_TICKS_LATE: Final = frozenset({"stall", "clock_set", "clock_stops", "clock_loops", "loops", "refuse_messages"})
# One sensor sends nothing, or less.
_ONE_IS_AWAY: Final = frozenset({"silent", "leaves", "dies", "halves", "restarts", "returns_silent"})
_BUGS: Final = ("a bug in syncrelay", "Traceback")


class Set(NamedTuple):
    """A set as it left: the number of each input's message, None where there was none."""

    at: float
    numbers: tuple[int | None, ...]


@dataclass(slots=True)
class _Open:
    """A set whose messages leave now, in the order of the inputs: the last so far is of input `last`."""

    at: float
    numbers: list[int | None]
    last: int = -1


class _Moment(NamedTuple):
    """A moment that could make a set: its first message, when the last was sent, and when the set left if it did."""

    topic: str
    number: int
    at: float
    came: float
    left: float | None


class Seen(NamedTuple):
    """What a report said first of a group."""

    at: float
    code: str
    about: frozenset[str]
    text: str


class Promises:
    """Watches a world, and tells in the end what did not hold."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.broken: list[str] = []
        self._groups = {each.name: each for each in world.plan.groups}
        self._sensors = {each.topic: each for each in world.plan.sensors}
        self._spoilt = {each.name: self._spoilt_of(each) for each in world.plan.groups}
        self.sets: dict[str, list[Set]] = defaultdict(list)
        self.seen: dict[str, list[Seen]] = defaultdict(list)
        self._open: dict[str, _Open] = {}
        self._written: dict[str, dict[int, float]] = defaultdict(dict)
        self._reports: dict[str, GroupReport] = {}
        self._judged: dict[str, float] = {}
        self._nameless: dict[tuple[str, str], float] = {}
        self._fed: dict[str, int] = {}
        self._misled: float | None = None
        self._running: set[GroupRelay] = set()
        self._taken: dict[str, dict[Reader, dict[bytes, list[int]]]] = defaultdict(lambda: defaultdict(dict))
        world.bus.written = self._on_write
        self._lost: Counter[str] = Counter()
        world.bus.taken = self._on_taken
        world.bus.lost = self._on_lost
        world.heard_write = self._on_heard
        world.drained = self._on_drained

    def _on_heard(self, topic: str, number: int) -> None:
        self._written[topic].setdefault(number, self.world.now)

    def _on_taken(self, reader: Reader, sample: Sample) -> None:
        relay = self.world.relay
        if relay is not None and reader.participant.process is relay.process:
            self._taken[reader.topic][reader].setdefault(sample.gid, []).append(sample.number)

    def _on_lost(self, reader: Reader) -> None:
        relay = self.world.relay
        self._lost[reader.topic] += relay is not None and reader.participant.process is relay.process

    def _on_write(self, writer: Writer, sample: Sample) -> None:
        place = self.world.outputs.get(writer.topic)
        relay = self.world.relay
        if place is None or relay is None or writer.participant.process is not relay.process:
            return
        group, index = place
        now, still = self.world.now, self.world.still_since
        if still is not None and still < now:
            self.broken.append(f"{now:.2f} s: {group}: a set left, though nothing was to since {still:.2f} s")
            self.world.still_since = None
        topics = self._groups[group].topics
        opened = self._open.get(group)
        if opened is not None and (opened.at != now or index <= opened.last):
            self._close(group)
            opened = None
        if opened is None:
            opened = self._open[group] = _Open(now, [None] * len(topics))
        sensor, number = identity(sample.content)
        if self.world.plan.sensors[sensor].topic != topics[index]:
            self.broken.append(f"{now:.2f} s: {writer.topic} carries a message of another topic")
        opened.numbers[index], opened.last = number, index

    def _close(self, group: str) -> None:
        opened = self._open.pop(group)
        self.sets[group].append(Set(opened.at, tuple(opened.numbers)))

    def _group(self, name: str) -> Group:
        return self._groups[name]

    def look(self, *, is_last: bool = False) -> None:
        """Take in what the relay reports now."""
        running = self.world.relay
        relay = running.relay if running is not None else None
        if running is None or relay is None:
            return
        self._look_at_phase(running, relay)
        self._look_at_ended(relay)
        for report in relay.monitor.reports:
            name = report.facts.name
            if self._reports.get(name) is report:
                self._look_for_unjudged(name)
                continue
            self._reports[name], self._judged[name] = report, self.world.now
            self._look_for_nameless(report)
            self._look_whether_asleep(report)
            for each in report.facts.inputs:
                counts = each.counts
                left = counts.matched + sum(counts.dropped.values()) + counts.buffered
                if is_last:
                    self._look_for_miscounted(name, each.graph)
                if each.graph.lost_in_all > (lost := self._lost[each.graph.name]):
                    what = f"{lost} messages lost, told {each.graph.lost_in_all}"
                    self.broken.append(f"{self.world.now:.2f} s: {name}: {each.name}: {what}")
                if counts.fed != left or (is_last and counts.buffered):
                    self.broken.append(f"{self.world.now:.2f} s: {name}: {each.name}: {counts} does not add up")
            self._look_for_impossible(report)
            first = explanation(report.findings)
            topics = self._group(name).topics
            about = frozenset(topics[index] for index in first.about)
            self.seen[name].append(Seen(self.world.now, first.code.value, about, first.text))
            told = [(each.code, each.about, each.text) for each in report.findings]
            self._look_for_punctual(name, [text for _, _, text in told])
            self.broken += [f"{self.world.now:.2f} s: {name}: {what}" for what in _against_graph(report)]
            if len(set(told)) < len(told):
                self.broken.append(f"{self.world.now:.2f} s: {name}: a finding is there twice: {told}")

    def _look_at_phase(self, running: RelayProcess, relay: "Relay") -> None:
        """Look whether the relay shows another phase than the one it was brought to, for longer than that takes."""
        node, now = running.node, self.world.now
        asked = [name for _, name, answer in self.world.answers if name in _PAUSES and answer and answer.success]
        awake = Phase.PAUSED if asked and asked[-1] == "pause" else Phase.RUNNING
        state = node.state if node is not None and self.world.plan.is_managed else "active"
        expected = awake if state == "active" else Phase(state)
        shown = relay._phase  # noqa: SLF001  to ask for the state has all groups evaluated each second
        pending = any(answer is None for *_, answer in self.world.answers)
        if running.requested or pending or shown is expected or self._happened({"stall"}, now - _SHOWN_BY_S, now):
            self._misled = None
        elif self._misled is None:
            self._misled = now
        elif now - self._misled > _SHOWN_BY_S:
            self.broken.append(f"{now:.2f} s: the relay is {shown.value}, not {expected.value}")
            self._misled = None

    def _look_at_ended(self, relay: "Relay") -> None:
        """Look whether something still waits in a group that runs no more."""
        running = set(relay._groups.bindings.groups)  # noqa: SLF001  reports are of those that run
        for group in self._running - running:
            if any(each.buffered for each in group.counts()):
                self.broken.append(f"{self.world.now:.2f} s: {group.config.name} has ended with {group.counts()}")
        self._running = running

    def _look_for_punctual(self, name: str, texts: Iterable[str]) -> None:
        """Look whether somebody is called silent who has more time to send."""
        for found in filter(None, map(_SILENT_FOR.search, texts)):
            topic, seconds = (each for each in found.groups() if each is not None)
            if float(seconds) < 1.5 / (self.world.plan.hz * self._sensors[topic].every):
                self.broken.append(f"{self.world.now:.2f} s: {name}: {found[0]}, which is as usual")

    def _look_for_miscounted(self, name: str, shown: "InputGraph") -> None:
        """Look whether all that was sent and did not come is counted, of topics that the relay has had throughout."""
        readers = self._taken[shown.name]
        if len(readers) != 1 or self._happened({"configure_again"}, 0, self.world.now):
            return
        (numbers,) = readers.values()
        told = [sum(each.sent_in_all for each in shown.senders), sum(each.delivered_in_all for each in shown.senders)]
        truth = [sum(each[-1] - each[0] + 1 for each in numbers.values()), sum(map(len, numbers.values()))]
        if told != truth:
            self.broken.append(f"{self.world.now:.2f} s: {name}: {shown.name}: {truth} sent and delivered, told {told}")

    def _look_for_impossible(self, report: "GroupReport") -> None:
        """Look whether more sets are called possible than messages can have come, also twice or kept ones."""
        share, fastest = (
            report.facts.figures.share,
            self.world.plan.hz * max(each.every for each in self._sensors.values()),
        )
        most = 2 * fastest * share.ns / SECOND + _KEPT
        if share.possible > most:
            what = f"{share.possible} sets are called possible in {share.ns / SECOND:.1f} s"
            self.broken.append(f"{self.world.now:.2f} s: {report.facts.name}: {what}, of {most:.0f} at most")

    def _look_for_unjudged(self, name: str) -> None:
        now, before = self.world.now, self._judged[name]
        if now - before > _JUDGED_S and not self._happened({"stall"}, before - 10, now):
            self.broken.append(f"{now:.2f} s: {name} was judged last at {before:.2f} s")
            self._judged[name] = now

    def _look_for_nameless(self, report: "GroupReport") -> None:
        for each in report.facts.inputs:
            is_nameless = any(not publisher.is_named for publisher in each.graph.publishers)
            if not is_nameless and not self._nameless:
                continue
            place = report.facts.name, each.name
            if not is_nameless:
                self._nameless.pop(place, None)
                continue
            since = self._nameless.setdefault(place, self.world.now)
            if self.world.now - since > _NAMED_BY_S:
                self.broken.append(f"{self.world.now:.2f} s: {place}: no name of a publisher since {since:.2f} s")
                self._nameless[place] = self.world.now

    def _look_whether_asleep(self, report: "GroupReport") -> None:
        name, away = report.facts.name, self.world.witness.away_since
        before, self._fed[name] = self._fed.get(name), sum(each.counts.fed for each in report.facts.inputs)
        is_asleep = away is not None and self.world.now - away > _ASLEEP_S and "lazy" in self._group(name).options
        if not is_asleep or self._happened({"stall"}, self.world.now - 30, self.world.now):
            self._fed.pop(name)
        elif before is not None and self._fed[name] > before:
            self.broken.append(f"{self.world.now:.2f} s: {name} is fed, though nobody has listened since {away:.2f} s")

    def _happened(self, kinds: Iterable[str], begin: float, end: float) -> bool:
        return any(
            step.kind in kinds and step.at <= end and begin <= step.at + step.seconds for step in self.world.plan.steps
        )

    def _on_drained(self) -> None:
        self.look(is_last=True)

    def judge(self) -> list[str]:
        """Return what did not hold."""
        for name in list(self._open):
            self._close(name)
        world, plan = self.world, self.world.plan
        for line in world.lines:
            if line.level >= logging.WARNING and any(bug in line.text for bug in _BUGS):
                self.broken.append(f"{line.at:.2f} s: {line.text}")
        for at, asked, answer in world.answers:
            if answer is None and at < plan.length - _ANSWERED_S:
                self.broken.append(f"{at:.2f} s: ~/{asked} got no answer")
        self.broken += self._pestered()
        for each in plan.groups:
            self.broken += self._wrong_sets(each)
            self.broken += self._missing_sets(each)
            self.broken += self._belied(each)
            self.broken += self._wrong_ticks(each)
            self.broken += self._false_findings(each)
        return self.broken

    def _pestered(self) -> Iterator[str]:
        for topic, times in self.world.refusals.items():
            for first, last in zip(times, times[_TRIES:], strict=False):
                if last - first < _TRIED_S and not self._happened({"reload_often"}, first - _TRIED_S, last):
                    yield f"{last:.2f} s: {topic}: {_TRIES + 1} refusals since {first:.2f} s"
                    return

    def _wrong_sets(self, group: Group) -> Iterator[str]:
        plan = self.world.plan
        used: dict[tuple[int, int], float] = {}
        odd = [step for step in plan.steps if step.kind in _ODD]
        for one in self.sets[group.name]:
            if any(step.at - 1 <= one.at <= step.at + step.seconds + _AGAIN_S for step in odd):
                continue
            where = f"{one.at:.2f} s: {group.name}: the set {one.numbers}"
            rows = list(zip(group.topics, one.numbers, strict=True))
            lacks = [topic for topic, number in rows if number is None and topic not in group.optional]
            if lacks and not group.by_clock:
                yield f"{where} lacks {lacks}"
            if sum(number is not None for number in one.numbers) < group.quorum:
                yield f"{where} has fewer than {group.quorum} messages"
            if group.repeats:
                continue
            moments = [self._moment(group, topic, number) for topic, number in rows if number is not None]
            if max(moments) - min(moments) > _ROUNDED:
                yield f"{where} is of several moments"
            yield from self._doubled(group, one, used, where)
        yield from self._disordered(group)

    def _moment(self, group: Group, topic: str, number: int) -> int:
        """Return the moment of a message as the group knows it: by its key, or by its clock, which shows some twice."""
        at = self.world.drivers[topic].sampled_at(number)
        return at if group.options["policy"] == "equal_key" else self.world.stamp_at(at)

    def _doubled(self, group: Group, one: Set, used: dict[tuple[int, int], float], where: str) -> Iterator[str]:
        for index, number in enumerate(one.numbers):
            if number is None:
                continue
            before = used.setdefault((index, number), one.at)
            if before < one.at and not self._may_come_again(group, one.at):
                yield f"{where} has a message that was in a set at {before:.2f} s"

    def _disordered(self, group: Group) -> Iterator[str]:
        calm = [each for each in self.sets[group.name] if self._is_calm(group, each.at)]
        for before, after in pairwise(calm) if not group.repeats else ():
            both = zip(before.numbers, after.numbers, strict=True)
            if any(one is not None and other is not None and other <= one for one, other in both):
                yield f"{after.at:.2f} s: {group.name}: {after.numbers} left after {before.numbers}"

    def _may_come_again(self, group: Group, now: float) -> bool:
        """Whether a message may have been received a second time: by a new subscription, from who keeps messages."""
        kept = self._is_kept(group)
        steps = [step for step in self.world.plan.steps if step.at <= now]
        return any(step.kind == "twice" or (kept and step.kind in _SUBSCRIBES_AGAIN) for step in steps)

    def _is_kept(self, group: Group) -> bool:
        return any(self._sensors[topic].durability == "transient_local" for topic in group.topics)

    def _spoilt_of(self, group: Group) -> list[tuple[float, float]]:
        """Return the times in which sets of a group may be missing."""
        plan = self.world.plan
        spoiling = [
            step
            for step in plan.steps
            if KINDS[step.kind].spoils
            and (concerns(step.kind, step.target, group) or self._keeps_groups_from_being_made(step))
        ]
        if group.quorum and not _overlap(spoiling):
            # There is always one more than a set needs.
            spoiling = [step for step in spoiling if step.kind not in _ONE_IS_AWAY]
        # The first trigger after a jump has nothing that is older.
        at_least = 2.0 if group.repeats else 0.0
        times = []
        for step in spoiling:
            # What waits for the next message waits for a second at most.
            kind, end = KINDS[step.kind], step.at + step.seconds + plan.prompt
            at_end = kind.at_end and not self._keeps_groups_from_being_made(step)
            times.append(((end if at_end else step.at) - _BEFORE_S, end + max(at_least, kind.again_s)))
        return [(0.0, SETTLED_S), *times]

    def _keeps_groups_from_being_made(self, step: Step) -> bool:
        """Whether groups are made, at first or anew, while none can be exchanged."""
        end = step.at + step.seconds + self.world.plan.prompt
        return KINDS[step.kind].at_end and (step.at < _MADE_BY_S or self._happened(_MADE_ANEW, step.at, end))

    def _is_calm(self, group: Group, at: float) -> bool:
        return not any(begin <= at <= end for begin, end in self._spoilt[group.name])

    def _moments(self, group: Group) -> Iterator[_Moment]:
        """Yield the moments of which all required inputs were sent, by the number of the first of them."""
        if group.quorum:
            yield from self._moments_of_any(group)
            return
        triggers = group.topics[:1] if group.repeats else group.required
        anchor = triggers[0]
        # The first of each: what publishers have kept may come and leave again, to a subscription that is made anew.
        sets = {each.numbers[group.topics.index(anchor)]: each.at for each in reversed(self.sets[group.name])}
        of = self._sensors[anchor].every
        for number, at in self._written[anchor].items():
            if number % of and not group.repeats:
                continue
            others = [self._written[topic].get(number // of * self._sensors[topic].every) for topic in triggers]
            came = [each for each in others if each is not None]
            if len(came) == len(others):
                yield _Moment(anchor, number, at, max(came), sets.get(number))

    def _moments_of_any(self, group: Group) -> Iterator[_Moment]:
        """Yield those of which enough inputs were sent."""
        sets = {
            number: each.at for each in reversed(self.sets[group.name]) for number in each.numbers if number is not None
        }
        for number in sorted({number for topic in group.topics for number in self._written[topic]}):
            came = sorted((at, topic) for topic in group.topics if (at := self._written[topic].get(number)) is not None)
            if len(came) >= group.quorum:
                at, topic = came[0]
                yield _Moment(topic, number, at, came[group.quorum - 1][0], sets.get(number))

    def _missing_sets(self, group: Group) -> Iterator[str]:
        """Yield the moments of which no set left though all was well, and the sets that took too long."""
        plan = self.world.plan
        end = min(plan.length, self.world.now) - _LATE_S - 2 / plan.hz - 1
        slack = _LATE_S + 2 / plan.hz + (0.3 if group.optional else 0)
        for anchor, number, at, came, left in () if group.by_clock else self._moments(group):
            if at > end or not self._is_calm(group, at - self._sensors[anchor].takes / SECOND):
                continue
            if left is None:
                yield f"{at:.2f} s: {group.name}: no set of message {number} of {anchor}"
                return
            if left > came + slack:
                yield f"{at:.2f} s: {group.name}: the set of message {number} of {anchor} left at {left:.2f} s"
                return

    def _belied(self, group: Group) -> Iterator[str]:
        """Yield what is said of a group's sets while those that leave show the contrary, whatever befalls it."""
        moments = [] if group.by_clock else list(self._moments(group))
        times = [each.came for each in moments]
        sent = [each.at for each in self.sets[group.name]]
        hz = self.world.plan.hz
        # The share of sets that left is of so long, or of 30 of them.
        share_s = max(10.0, 30 / hz) + 2 * _LOOKS_S
        healthy_since = None
        for before, seen in pairwise(self.seen[group.name]):
            goes_on = seen.code == "healthy" and seen.at - before.at < _LOOKS_S
            healthy_since = (healthy_since or seen.at) if goes_on else None
            end = bisect_left(times, seen.at - _LATE_S)
            possible = end - bisect_left(times, seen.at - _SHOWN_S)
            is_well = healthy_since is not None and seen.at - healthy_since > _SHOWN_S
            if is_well and bisect_left(sent, seen.at) - bisect_left(sent, seen.at - _SHOWN_S) < possible / 3 - 5:
                yield f"{seen.at:.2f} s: {group.name}: {seen.code}: {seen.text}\n    but few sets leave"
                return
            begin = bisect_left(times, seen.at - share_s)
            is_bad = seen.code in _SETS_ARE_MISSING and end - begin > (share_s - _LATE_S) * hz - 3
            ended = seen.at - share_s - _AGAIN_S
            if not is_bad or not self._is_calm(group, seen.at) or self._happened(_BETWEEN, ended, seen.at):
                continue
            if all(each.left is not None and each.left < seen.at for each in moments[begin:end]):
                what = f"{end - begin} of {end - begin} sets left in the last {share_s:g} s"
                yield f"{seen.at:.2f} s: {group.name}: {seen.code}: {seen.text}\n    but {what}"
                return

    def _wrong_ticks(self, group: Group) -> Iterator[str]:
        """Yield where more or fewer sets left than there were ticks."""
        if not group.by_clock or self.world.plan.by_sim_time:
            return
        times = [each.at for each in self.sets[group.name]]
        for first in range(ceil(min(self.world.now, self.world.plan.length)) - 5):
            last = first + 2
            count = bisect_left(times, last) - bisect_left(times, first)
            ticks = 2 * self.world.plan.hz
            is_calm = self._is_calm(group, first) and self._is_calm(group, last)
            # Those that waited for transforms leave at once when these come.
            waited = self.world.plan.hz if "transforms" in group.options else 0
            many = count > ticks + waited + 2 and not self._happened(_TICKS_LATE, first - 10, last)
            if many or (count < ticks - 2 and is_calm):
                yield f"{first} s: {group.name}: {count} sets in 2 s, of {ticks:g} ticks"
                return

    def _false_findings(self, group: Group) -> Iterator[str]:
        plan = self.world.plan
        steps = [step for step in plan.steps if concerns(step.kind, step.target, group)]
        told_from, lasting = self._once_healed(steps)
        for seen in self.seen[group.name]:
            if seen.at > plan.length:
                return
            if seen.at <= told_from:
                continue
            if seen.at < SETTLED_S:
                # Who sends transforms may be found later than the sensors, and sets do not wait for that; nor, once
                # there is a simulated clock, any longer if they were matched before.
                late = {"no_transform"} if plan.transforms and (plan.missed or plan.by_sim_time) else set[str]()
                if seen.code not in _QUIET | _AT_FIRST | late:
                    yield f"{seen.at:.2f} s: {group.name}: {seen.code}: {seen.text}\n    is said at once"
                    return
                continue
            yield from self._of_another_time(group, seen)
            near = [step for step in steps if step.at - 1 <= seen.at <= step.at + step.seconds + HEALED_S]
            allowed = self._allowed(group, near, seen.at) | lasting
            what = f"{seen.at:.2f} s: {group.name}: {seen.code}: {seen.text}"
            if seen.code not in allowed:
                yield f"{what}\n    is not so; allowed: {sorted(allowed)}"
                return
            for step in near:
                if (
                    is_felt(step.kind, step.target, group, plan)
                    and not (step.kind == "halves" and self._had_two_paces(step))
                    and step.at + NAMED_S <= seen.at <= step.at + step.seconds
                    and seen.code not in KINDS[step.kind].names
                ):
                    yield f"{what}\n    does not name the fault: {step.kind} {step.target} since {step.at:.2f} s"
                    return
                if (
                    step.target in group.topics
                    and seen.code in KINDS[step.kind].names
                    and seen.about
                    and step.target not in seen.about
                ):
                    yield f"{what}\n    is about {sorted(seen.about)} and not {step.target}"
                    return

    def _once_healed(self, steps: Sequence[Step]) -> tuple[float, frozenset[str]]:
        """Return from when on a group is told truly, and what is so for good.

        What befalls it at once may be told as anything; once all is over and healed, it is well.
        """
        if not _overlap(steps):
            return 0.0, frozenset()
        # Who has sent twice as often for most of the time has slowed down since.
        lasting = frozenset({"slowed"}) if any(step.kind == "doubles" for step in steps) else frozenset()
        return max(step.at + step.seconds for step in steps) + self.world.plan.prompt + HEALED_S, lasting

    def _had_two_paces(self, step: Step) -> bool:
        """Whether a sensor has had another pace than its own lately, and so no steady one that it could fall below."""
        return any(
            each.kind == "doubles" and each.target == step.target and step.at - each.at - each.seconds < _PACES_S
            for each in self.world.plan.steps
            if each.at < step.at
        )

    def _of_another_time(self, group: Group, seen: Seen) -> Iterator[str]:
        """Yield what blames somebody who has just come, or who was away and has come back."""
        for topic in seen.about if seen.code in ("silent", "no_publisher") else ():
            driver = self.world.drivers[topic]
            here = next((seen.at - begin for begin, end in driver.lives if begin <= seen.at <= end), 0.0)
            died = driver.died is not None and driver.died <= seen.at <= driver.died + 30
            what = f"{seen.at:.2f} s: {group.name}: {seen.code}: {seen.text}"
            if seen.code == "silent" and 0 < here < _ABOUT_TO_SEND_S and not died:
                yield f"{what}\n    but it has just come"
            if seen.code == "no_publisher" and "until " not in seen.text and here > _HERE_S and driver.type == TYPE:
                yield f"{what}\n    but it has been there for {here:.1f} s"

    def _allowed(self, group: Group, near: list[Step], at: float) -> frozenset[str]:
        """Return what may be found first, a while before a fault is named and after it has ended too."""
        kinds = {step.kind for step in near}
        allowed = _QUIET.union(*(KINDS[kind].names for kind in kinds))
        if any(KINDS[kind].spoils for kind in kinds):
            # Before its cause is known, and while the sets that it cost count.
            allowed |= {"few_sets"}
            ends = (step.at + step.seconds for step in near if step.kind in _RETURN_TWICE)
            if any(at - step.at <= NAMED_S for step in near) or any(0 <= at - end <= NAMED_S for end in ends):
                allowed |= {"over_slop"}
            allowed |= {"waiting_for_optional"} if group.optional else set()
        if self.world.plan.by_sim_time and "other_clock" in kinds:
            # With a simulated clock, steps ahead are told by the stamps of all messages alone: that takes a while.
            allowed |= {"unexplained", "over_slop"}
        if kinds & _RETURNS:
            # Before it has found the relay, a reliable publisher keeps what it sends.
            allowed |= {"bursts"}
        if self._is_kept(group) and kinds & (_SUBSCRIBES_AGAIN | _RETURNS):
            # What a publisher keeps comes all at once, and may have come before.
            allowed |= {"bursts", "duplicates", "out_of_order", "short_queue"}
        return allowed


def _against_graph(report: "GroupReport") -> Iterator[str]:
    """Yield what is said against what the graph shows at this look."""
    inputs = report.facts.inputs
    for each in report.findings:
        for index in each.about if each.code in _IN_GRAPH and not each.is_over else ():
            if not _IN_GRAPH[each.code](inputs[index].graph):
                yield f"{each.code.value}: {each.text}\n    but the graph shows {inputs[index].graph.publishers}"
    first = explanation(report.findings)
    if first.code in MATCHING and not first.is_over:
        for an_input in inputs:
            if an_input.required and an_input.graph.publishers and not serving(an_input.graph, TYPE):
                what = f"nothing of {an_input.name} can be received"
                yield f"{first.code.value}: {first.text}\n    but {what}: {an_input.graph.publishers}"


def _overlap(steps: Iterable[Step]) -> bool:
    ordered = sorted(steps)
    return any(after.at < before.at + before.seconds + HEALED_S for before, after in pairwise(ordered)) or any(
        step.at < SETTLED_S for step in ordered
    )


def unnamed(plan: Plan) -> list[str]:
    """Return the kinds of steps that a plan has and nobody knows."""
    return [step.kind for step in plan.steps if step.kind not in KINDS]
