"""What must hold in every world, judged by what the world knows and not by what the relay says of itself."""

import logging
from collections import defaultdict
from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Final, NamedTuple

from syncrelay.explain import explanation
from tests.simulated.bus import Sample, Writer
from tests.simulated.faults import KINDS, concerns, is_felt
from tests.simulated.plan import HEALED_S, NAMED_S, SETTLED_S, Group, Plan, Step
from tests.simulated.world import World, identity

if TYPE_CHECKING:
    from syncrelay.explain import GroupReport

# Sets are complete again so long after a fault has ended, and may be missing so long before it began.
_AGAIN_S: Final = 15.0
_BEFORE_S: Final = 2.5
# A set may take so long beside what its policy waits for.
_LATE_S: Final = 1.5
_ANSWERED_S: Final = 15.0
_QUIET: Final = frozenset({"healthy", "starting", "nobody_listens"})
# Messages are of no known moment, or cannot leave.
_ODD: Final = frozenset({"doubles", "refuse_messages", "second_publisher", "other_clock", "unstamped"})
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
_RETURNS: Final = frozenset({"dies", "dies_in_write", "leaves", "other_type", "restarts"})
_BUGS: Final = ("a bug in syncrelay", "Traceback")


class Set(NamedTuple):
    """A set as it left: the number of each input's message, None where there was none."""

    at: float
    numbers: tuple[int | None, ...]


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
        self.sets: dict[str, list[Set]] = defaultdict(list)
        self.seen: dict[str, list[Seen]] = defaultdict(list)
        self._open: dict[str, tuple[float, dict[int, int]]] = {}
        self._written: dict[str, dict[int, float]] = defaultdict(dict)
        self._reports: dict[str, GroupReport] = {}
        world.bus.written = self._on_write
        world.heard_write = self._on_heard
        world.drained = self._on_drained

    def _on_heard(self, topic: str, number: int) -> None:
        self._written[topic].setdefault(number, self.world.now)

    def _on_write(self, writer: Writer, sample: Sample) -> None:
        place = self.world.outputs.get(writer.topic)
        relay = self.world.relay
        if place is None or relay is None or writer.participant.process is not relay.process:
            return
        group, index = place
        at, inputs = self._open.get(group, (0.0, {}))
        if inputs and (index <= max(inputs) or at != self.world.now):
            self._close(group)
            inputs = {}
        sensor, number = identity(sample.content)
        if self.world.plan.sensors[sensor].topic != self._group(group).topics[index]:
            self.broken.append(f"{self.world.now:.2f} s: {writer.topic} carries a message of another topic")
        self._open[group] = self.world.now, {**inputs, index: number}

    def _close(self, group: str) -> None:
        at, inputs = self._open.pop(group)
        numbers = tuple(inputs.get(index) for index in range(len(self._group(group).topics)))
        self.sets[group].append(Set(at, numbers))

    def _group(self, name: str) -> Group:
        return self._groups[name]

    def look(self, *, is_last: bool = False) -> None:
        """Take in what the relay reports now."""
        running = self.world.relay
        relay = running.relay if running is not None else None
        if relay is None:
            return
        for report in relay.monitor.reports:
            name = report.facts.name
            if self._reports.get(name) is report:
                continue
            self._reports[name] = report
            for each in report.facts.inputs:
                counts = each.counts
                left = counts.matched + sum(counts.dropped.values()) + counts.buffered
                if counts.fed != left or (is_last and counts.buffered):
                    self.broken.append(f"{self.world.now:.2f} s: {name}: {each.name}: {counts} does not add up")
            first = explanation(report.findings)
            topics = self._group(name).topics
            about = frozenset(topics[index] for index in first.about)
            self.seen[name].append(Seen(self.world.now, first.code.value, about, first.text))
            told = [(each.code, each.about, each.text) for each in report.findings]
            if len(set(told)) < len(told):
                self.broken.append(f"{self.world.now:.2f} s: {name}: a finding is there twice: {told}")

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
        for each in plan.groups:
            self.broken += self._wrong_sets(each)
            self.broken += self._missing_sets(each)
            self.broken += self._false_findings(each)
        return self.broken

    def _wrong_sets(self, group: Group) -> Iterator[str]:
        plan = self.world.plan
        used: dict[tuple[int, int], float] = {}
        for one in self.sets[group.name]:
            if any(
                step.kind in _ODD and step.at - 1 <= one.at <= step.at + step.seconds + _AGAIN_S for step in plan.steps
            ):
                continue
            where = f"{one.at:.2f} s: {group.name}: the set {one.numbers}"
            rows = list(zip(group.topics, one.numbers, strict=True))
            lacks = [topic for topic, number in rows if number is None and topic not in group.optional]
            if lacks and not group.by_clock:
                yield f"{where} lacks {lacks}"
            if group.repeats:
                continue
            if len({number / plan.sensor(topic).every for topic, number in rows if number is not None}) > 1:
                yield f"{where} is of several moments"
            yield from self._doubled(group, one, used, where)
        yield from self._disordered(group)

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
        return any(self.world.plan.sensor(topic).durability == "transient_local" for topic in group.topics)

    def _spoilt(self, group: Group) -> list[tuple[float, float]]:
        """Return the times in which sets of a group may be missing."""
        plan = self.world.plan
        spoiling = (step for step in plan.steps if KINDS[step.kind].spoils and concerns(step.kind, step.target, group))
        times = [(step.at - _BEFORE_S, step.at + step.seconds + _AGAIN_S) for step in spoiling]
        return [(0.0, SETTLED_S), *times]

    def _is_calm(self, group: Group, at: float) -> bool:
        return not any(begin <= at <= end for begin, end in self._spoilt(group))

    def _missing_sets(self, group: Group) -> Iterator[str]:
        """Yield the moments of which no set left though all was well, and the sets that took too long."""
        world, plan = self.world, self.world.plan
        if group.by_clock:
            return
        end = min(plan.length, world.now) - _LATE_S - 2 / plan.hz - 1
        spoilt = self._spoilt(group)
        slack = _LATE_S + 2 / plan.hz + (0.3 if group.optional else 0)
        triggers = group.topics[:1] if group.repeats else group.required
        anchor = triggers[0]
        sets = {each.numbers[group.topics.index(anchor)]: each for each in self.sets[group.name]}
        of = plan.sensor(anchor).every
        for number, at in self._written[anchor].items():
            if number % of and not group.repeats:
                continue
            if at > end or any(begin <= at <= over for begin, over in spoilt):
                continue
            moment = number // of
            others = [self._written[topic].get(moment * plan.sensor(topic).every) for topic in triggers]
            if None in others:
                continue
            came = max(each for each in others if each is not None)
            left = sets.get(number)
            if left is None:
                yield f"{at:.2f} s: {group.name}: no set of message {number} of {anchor}"
                return
            if left.at > came + slack:
                yield f"{at:.2f} s: {group.name}: the set of message {number} of {anchor} left at {left.at:.2f} s"
                return

    def _false_findings(self, group: Group) -> Iterator[str]:
        plan = self.world.plan
        steps = [step for step in plan.steps if concerns(step.kind, step.target, group)]
        if _overlap(steps):
            return
        for seen in self.seen[group.name]:
            if seen.at < SETTLED_S:
                continue
            near = [step for step in steps if step.at - 1 <= seen.at <= step.at + step.seconds + HEALED_S]
            allowed = self._allowed(group, near, seen.at)
            what = f"{seen.at:.2f} s: {group.name}: {seen.code}: {seen.text}"
            if seen.code not in allowed:
                yield f"{what}\n    is not so; allowed: {sorted(allowed)}"
                return
            for step in near:
                if (
                    is_felt(step.kind, step.target, group, plan)
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

    def _allowed(self, group: Group, near: list[Step], at: float) -> frozenset[str]:
        """Return what may be found first, a while before a fault is named and after it has ended too."""
        kinds = {step.kind for step in near}
        allowed = _QUIET.union(*(KINDS[kind].names for kind in kinds))
        if any(KINDS[kind].spoils for kind in kinds):
            # Before its cause is known, and while the sets that it cost count.
            allowed |= {"few_sets"}
            if any(at - step.at <= NAMED_S for step in near):
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


def _overlap(steps: Iterable[Step]) -> bool:
    ordered = sorted(steps)
    return any(after.at < before.at + before.seconds + HEALED_S for before, after in pairwise(ordered)) or any(
        step.at < SETTLED_S for step in ordered
    )


def unnamed(plan: Plan) -> list[str]:
    """Return the kinds of steps that a plan has and nobody knows."""
    return [step.kind for step in plan.steps if step.kind not in KINDS]
