"""What happens in a world: its rig, and the faults that it meets, drawn by a seed or cut down from such a plan."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from random import Random
from typing import Any, Final, NamedTuple

from tests.simulated.scheduler import MS

# The relay imports the type of /tf, which the wheels lack and a C++ compiler has to make.
_CAN_TRANSFORM: Final = find_spec("tf2_msgs") is not None

# A rig has found itself by then, and what is said of it is to be true.
SETTLED_S: Final = 25.0
# What is to be named is named within this.
NAMED_S: Final = 22.0
# What changes the clocks of stamps: transforms do not cover these, by right.
_OTHER_STAMPS: Final = frozenset(
    {"other_clock", "stamps_early", "second_publisher", "clock_set", "clock_stops", "clock_loops", "loops"}
)
# All is well again so long after a fault has ended.
HEALED_S: Final = 60.0


@dataclass(frozen=True, slots=True)
class Sensor:
    """A driver with a topic of its own; all sample on one grid of moments."""

    topic: str
    every: int
    """How many of its samples come at each moment of the rig: 1 for the slowest sensors."""
    wobble: int
    """How far a stamp may be from its place, in nanoseconds."""
    takes: int
    """How long after its stamp a message is published, in nanoseconds."""
    reliability: str
    durability: str
    depth: int


@dataclass(frozen=True, slots=True)
class Group:
    """A group of the file."""

    name: str
    topics: tuple[str, ...]
    options: Mapping[str, Any]
    inputs: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    @property
    def optional(self) -> frozenset[str]:
        if self.quorum:
            return frozenset(self.topics)
        return frozenset(topic for topic, keys in self.inputs.items() if keys.get("required") is False)

    @property
    def quorum(self) -> int:
        """How many inputs a set needs, whichever they are; 0 where it is those that are required."""
        return int(self.options.get("quorum", 0))

    @property
    def repeats(self) -> bool:
        """Whether a message may be in several sets."""
        return bool(self.options["policy"] == "latest_time")

    @property
    def by_clock(self) -> bool:
        return str(self.options.get("trigger", "")).endswith("Hz")

    @property
    def required(self) -> tuple[str, ...]:
        return tuple(each for each in self.topics if each not in self.optional)

    def in_file(self, *, slop_factor: int = 1) -> dict[str, Any]:
        """As it stands in the file; another `slop_factor` makes it another group that does the same."""
        options = dict(self.options)
        options["queue_size"] = options["queue_size"] + slop_factor - 1
        rows = [{"topic": each, "type": TYPE, **self.inputs.get(each, {})} for each in self.topics]
        return {**options, "topics": rows}


TRANSFORMS: Final = {"target": "odom", "wait": "1s"}
TYPE: Final = "geometry_msgs/msg/Vector3Stamped"


class Step(NamedTuple):
    """Something that happens."""

    at: float
    kind: str
    """A name in tests.simulated.faults."""
    target: str
    """A topic, or the name of a group; empty where it is about the relay or all."""
    seconds: float
    """How long it lasts."""


@dataclass(frozen=True, slots=True)
class Plan:
    """A world."""

    seed: int
    sensors: tuple[Sensor, ...]
    groups: tuple[Group, ...]
    steps: tuple[Step, ...]
    length: float
    """How long it lasts, in seconds; then the relay is asked to end."""
    hz: float
    """The moments of the rig in a second."""
    node: Mapping[str, Any] = field(default_factory=dict)
    """Keys of the file's section."""
    eagerness: float = 0.0
    lag_ms: float = 0.0
    latency_ms: float = 1.0
    discovery_ms: float = 100.0
    missed: float = 0.0
    """How often a participant that joins is found only by the next announcement."""
    watched: bool = False
    """Whether the relay runs with --watch."""
    transforms: bool = False
    """Whether sets wait for transforms, which somebody publishes."""
    prompt: bool = False
    """Whether what happens waits for a message that has arrived and that nobody has taken."""

    @property
    def by_sim_time(self) -> bool:
        return bool(self.node.get("use_sim_time"))

    @property
    def is_managed(self) -> bool:
        return bool(self.node.get("lifecycle"))

    def sensor(self, topic: str) -> Sensor:
        return next(each for each in self.sensors if each.topic == topic)

    def described(self) -> str:
        """Say it in a few lines."""
        steps = "\n".join(f"  {s.at:7.2f} s  {s.kind} {s.target} for {s.seconds:.2f} s" for s in self.steps)
        groups = "\n".join(f"  {each.name}: {each.in_file()}" for each in self.groups)
        sensors = "\n".join(f"  {each}" for each in self.sensors)
        odd = {
            key: getattr(self, key)
            for key in (
                "node",
                "eagerness",
                "lag_ms",
                "latency_ms",
                "discovery_ms",
                "missed",
                "watched",
                "transforms",
                "prompt",
            )
        }
        return f"{self.length:.0f} s at {self.hz:g} Hz, {odd}\n{sensors}\n{groups}\n{steps}"

    def smaller(self) -> Iterator["Plan"]:
        """Yield plans with a little less in them, the smallest first."""
        for step in self.steps:
            yield replace(self, steps=tuple(each for each in self.steps if each is not step))
        for group in self.groups if len(self.groups) > 1 else ():
            yield self._without(group)
        if self.steps:
            last = max(step.at + step.seconds for step in self.steps)
            for length in (last + 5, last + HEALED_S / 2, last + HEALED_S + 5):
                if length < self.length - 1:
                    yield replace(self, length=length)
        elif self.length > SETTLED_S:
            yield replace(self, length=self.length / 2)
        if self.eagerness or self.lag_ms:
            yield replace(self, eagerness=0.0, lag_ms=0.0)

    def _without(self, group: Group) -> "Plan":
        groups = tuple(each for each in self.groups if each is not group)
        used = {topic for each in groups for topic in each.topics}
        sensors = tuple(each for each in self.sensors if each.topic in used)
        gone = {group.name, *(each.topic for each in self.sensors if each.topic not in used)}
        steps = tuple(each for each in self.steps if each.target not in gone)
        return replace(self, groups=groups, sensors=sensors, steps=steps)


def draw(seed: int, kinds: Mapping[str, Sequence[str]]) -> Plan:
    """Draw a world. `kinds` says of each kind of step what it is about, and what the world must be like for it."""
    chance = Random(f"world {seed}")
    # One kind is drawn first, and the world is made for it: what few worlds allow is as frequent as the rest.
    first = chance.choice([*kinds])
    needs = kinds[first]
    exact = chance.random() < 0.3
    # Each message costs as much as the last: a queue of 20 overflows at 15 Hz, when 1.5 s come at once.
    hz = chance.choice([2.0, 2.0, 3.0, 3.0, 5.0])
    # Fast sensors that are out of step would make sets between the moments.
    every = 1 if exact else chance.choice([1, 2, 3])
    sensors = tuple(
        _sensor(chance, number, every=every, exact=exact) for number in range(chance.choice([2, 2, 3, 3, 4]))
    )
    groups = tuple(
        _group(chance, f"g{n}", sensors, exact=exact, hz=hz)
        for n in range(chance.choice([2, 3] if "several" in needs else [1, 1, 2, 3]))
    )
    # By chance of its own: worlds without transforms are those that they were.
    by_key = any("key" in group.options for group in groups)
    transforms = (
        _CAN_TRANSFORM and not by_key and ("transforms" in needs or Random(f"transforms {seed}").random() < 0.25)
    )
    if transforms:
        groups = tuple(replace(each, options={**each.options, "transforms": TRANSFORMS}) for each in groups)
    # By chances of their own: worlds without such a group stay as they were.
    groups = tuple(_with_quorum(Random(f"quorum {seed} {each.name}"), each, sensors) for each in groups)
    used = {topic for group in groups for topic in group.topics}
    sensors = tuple(each for each in sensors if each.topic in used)
    node: dict[str, Any] = {}
    if "sim" in needs or ("real" not in needs and chance.random() < 0.15):
        node["use_sim_time"] = True
    if "managed" in needs or chance.random() < 0.15:
        node["lifecycle"] = True
    chaotic = "start" in needs or chance.random() < 0.35
    plan = Plan(
        seed,
        sensors,
        groups,
        (),
        0.0,
        hz,
        node=node,
        eagerness=chance.choice([0.0, 0.0, 0.1, 0.5]),
        lag_ms=chance.choice([0.0, 0.0, 20.0]),
        latency_ms=chance.choice([0.2, 1.0, 10.0]),
        discovery_ms=chance.choice([20.0, 100.0, 900.0]),
        missed=chance.choice([0.0, 0.0, 0.3]),
        watched=chance.random() < 0.3,
        transforms=transforms,
        prompt=chance.random() < 0.5,
    )
    steps = tuple(sorted(_steps(chance, plan, kinds, first, chaotic=chaotic)))
    last = max((step.at + step.seconds for step in steps), default=SETTLED_S)
    # It may end amid all that, or when all of it is long over.
    rest = chance.choice([chance.uniform(0, 20), *2 * [HEALED_S + 15]]) if chaotic else HEALED_S + 15
    return replace(plan, steps=steps, length=last + rest)


def _sensor(chance: Random, number: int, *, every: int, exact: bool) -> Sensor:
    return Sensor(
        topic=f"/s{number}",
        every=chance.choice([1, 1, every]),
        wobble=0 if exact else 1 * MS,
        takes=chance.choice([chance.randrange(1, 30), chance.randrange(1, 200)]) * MS,
        reliability=chance.choice(["reliable", "reliable", "best_effort"]),
        durability=chance.choice(["volatile", "volatile", "transient_local"]),
        depth=chance.choice([5, 10, 100]),
    )


def _group(chance: Random, name: str, sensors: Sequence[Sensor], *, exact: bool, hz: float) -> Group:
    chosen = chance.sample(sensors, k=chance.randint(2, len(sensors)))
    policies = ["approximate_time", "approximate_time_eager", "latest_time", "ticks"]
    if exact:
        policies += ["exact_time", "exact_time", "approximate_epsilon_time"]
    if all(each.every == 1 for each in chosen):
        policies += ["equal_key", "approximate_epsilon_time"]
    policy = chance.choice(policies)
    if policy == "latest_time":
        chosen.sort(key=lambda each: each.every)
    options = {"queue_size": chance.choice([10, 20, 30]), **_options(policy, chosen[0].topic, hz)}
    inputs: dict[str, dict[str, Any]] = {}
    if policy in ("approximate_time", "exact_time", "latest_time") and len(chosen) > 2 and chance.random() < 0.3:
        inputs[chosen[-1].topic] = {"required": False}
        if policy != "latest_time":
            options["max_wait"] = "300ms"
    if chance.random() < 0.3:
        options["lazy"] = True
    if chance.random() < 0.2:
        options["manifest"] = False
    return Group(name, tuple(each.topic for each in chosen), options, inputs)


def _with_quorum(chance: Random, group: Group, sensors: Sequence[Sensor]) -> Group:
    """Have some groups of three or more be content with any so many."""
    is_even = all(each.every == 1 for each in sensors if each.topic in group.topics)
    can_be = group.options["policy"] in ("approximate_time", "exact_time") and len(group.topics) > 2 and is_even
    if not can_be or chance.random() < 0.3:
        return group
    options = {**group.options, "quorum": chance.randrange(1, len(group.topics)), "max_wait": "300ms"}
    return replace(group, options=options, inputs={})


def _options(policy: str, first: str, hz: float) -> dict[str, Any]:
    match policy:
        case "exact_time":
            return {"policy": policy}
        case "equal_key":
            return {"policy": policy, "key": "header.frame_id"}
        case "latest_time":
            return {"policy": policy, "trigger": first, "max_age": "2s"}
        case "ticks":
            return {"policy": "latest_time", "trigger": f"{hz:g} Hz", "max_age": "2s", "max_wait": "50ms"}
    return {"policy": policy, "slop": "30ms"}


def _steps(
    chance: Random, plan: Plan, kinds: Mapping[str, Sequence[str]], first: str, *, chaotic: bool
) -> Iterator[Step]:
    """Draw what happens: one fault after the other, each healed before the next; or, in chaos, all at once."""
    at = SETTLED_S + chance.uniform(0, 10)
    fit = [kind for kind, needs in kinds.items() if _fits(plan, needs) and (chaotic or "start" not in needs)]
    fit = [kind for kind in fit if not plan.transforms or kind not in _OTHER_STAMPS]
    # A few kinds again and again meet in more ways than one of each.
    begin = [first] if first in fit else []
    fit = [*begin, *chance.sample(fit, k=chance.choice([4, 8, len(fit)]))] if chaotic else fit
    # What happened within a minute is seen longest where all of it was at its begin.
    within = chance.choice([20.0, 60.0])
    for _ in range(chance.randint(4, 14) if chaotic else chance.choice([1, 1, 2, 3])):
        kind = begin.pop() if begin else chance.choice(fit)
        target = ""
        if "sensor" in kinds[kind]:
            target = chance.choice(plan.sensors).topic
        elif "group" in kinds[kind]:
            target = chance.choice(plan.groups).name
        is_brief = "brief" in kinds[kind]
        if chaotic:
            at = 0.0 if "start" in kinds[kind] else chance.uniform(2, within)
            seconds = chance.choice([0.3, 3.0, chance.uniform(0, within / 2)])
            yield Step(at, kind, target, 0.0 if is_brief else seconds)
            continue
        seconds = 0.0 if is_brief else chance.uniform(NAMED_S + 5, NAMED_S + 25)
        yield Step(at, kind, target, seconds)
        at += seconds + HEALED_S + chance.uniform(15, 25)


def _fits(plan: Plan, needs: Sequence[str]) -> bool:
    return (
        ("sim" not in needs or plan.by_sim_time)
        and ("real" not in needs or not plan.by_sim_time)
        and ("managed" not in needs or plan.is_managed)
        and ("played" not in needs or not any(each.by_clock for each in plan.groups))
        and ("several" not in needs or len(plan.groups) > 1)
        and ("transforms" not in needs or plan.transforms)
    )
