"""Groups with every default filled in; of a file with faults, as far as they could be read."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from syncrelay.clock import DeviceClock, Step
from syncrelay.config.bundle import BundledInput, BundleKeys
from syncrelay.config.file import FileKeys
from syncrelay.config.listen import DEFAULT_HOST, DEFAULT_PORTS, Listen, parse_listen
from syncrelay.config.models import Distance, Group, Inputs, PacedTopic, StampSource, Tolerance, Topic
from syncrelay.config.names import default_output
from syncrelay.config.problems import Path
from syncrelay.config.qos import QosOverrides, QosPreset
from syncrelay.config.sections import MetricsConfig, NodeConfig
from syncrelay.sync import Restamp, SyncGroup, Ticks, Transforms
from syncrelay.sync.transforms import Chains


@dataclass(frozen=True, slots=True)
class TopicConfig:
    """An input and its output: that of its own, or the bundle's where there are no others.

    `type` is None where no group of the file says it: the graph or the recording does. `stamp` is "header", "receive"
    or a StampField with the path of the field; `key` the path of the field to match by, None where stamps are matched.
    `tolerance` is how far its stamps may be from those of its set, None where any distance will do. Where
    `is_of_device`, its stamps are of a clock of its own, and its messages arrive no sooner than `delay_ns` after them.
    One that is `in_quorum` is not required, and counts as one of those of which a set needs so many.
    """

    topic: str
    type: str | None
    output: str
    qos: QosPreset | QosOverrides
    offset_ns: int
    min_period_ns: int
    stamp: StampSource
    required: bool
    key: str | None
    tolerance: Tolerance | None
    is_of_device: bool = False
    delay_ns: int = 0
    in_quorum: bool = False

    @property
    def is_by_header(self) -> bool:
        """Whether its messages are matched by the stamp of their header as it is."""
        return self.stamp == "header" and not self.is_of_device

    def device_clock(self, stepped: Callable[[Step], None] | None = None) -> DeviceClock | None:
        """Return what maps its stamps from now on, and who hears of steps; None where they are of the host's time."""
        return DeviceClock(delay_ns=self.delay_ns, stepped=stepped) if self.is_of_device else None


@dataclass(frozen=True, slots=True)
class BundleConfig:
    """The message that holds a whole set. `fields` are those that the file names for each input, None for others."""

    topic: str
    type: str
    fields: tuple[str | None, ...]
    qos: QosPreset | QosOverrides


@dataclass(frozen=True)
class GroupConfig:
    """A group. `restamp` is the engine's: None, one of Restamp, or an input's index.

    `trigger` is the index of the input whose every message makes a set, None where all inputs are alike or a clock
    makes them. In a faulty file both are also None where what they name is no input.
    """

    name: str
    topics: tuple[TopicConfig, ...]
    restamp: Restamp | int | None
    trigger: int | None
    options: Group
    inputs: Inputs
    bundle: BundleConfig | None = None

    @property
    def outputs(self) -> tuple[str, ...]:
        """The topics that its sets leave on, each once: the outputs of its inputs, and that of its bundle."""
        bundle = () if self.bundle is None else (self.bundle.topic,)
        return tuple(dict.fromkeys((*(topic.output for topic in self.topics), *bundle)))

    def bundled(self) -> tuple[BundledInput, ...]:
        """Return what its bundle is to hold. The file has the types of the inputs of a bundle."""
        fields = (None,) * len(self.topics) if self.bundle is None else self.bundle.fields
        rows = zip(self.topics, fields, strict=True)
        return tuple(BundledInput(topic.topic, topic.type or "", field) for topic, field in rows)

    @property
    def path(self) -> Path:
        """Where it stands in the file."""
        return ("groups", self.name)

    @property
    def ticks(self) -> Ticks | None:
        """The ticks of the clock that makes its sets; None where messages do."""
        return self.options.ticks

    @cached_property
    def required(self) -> tuple[int, ...]:
        """The inputs that every set needs."""
        return tuple(index for index, topic in enumerate(self.topics) if topic.required)

    @property
    def quorum(self) -> int:
        """How many inputs a set needs, the required ones among them."""
        return max(len(self.required), self.options.quorum or 0)

    def enough(self, numbers: Sequence[float]) -> tuple[int, ...]:
        """Return the required inputs, and with a `quorum` as many of the others: those with the greatest numbers."""
        required = self.required
        if (self.options.quorum or 0) <= len(required):
            return required
        others = sorted(
            (index for index in range(len(self.topics)) if index not in required), key=lambda i: -numbers[i]
        )
        return tuple(sorted((*required, *others[: self.quorum - len(required)])))

    @property
    def has_deadlines(self) -> bool:
        """Whether sets may leave as time passes; if not, `expire` never returns anything."""
        options = self.options
        return options.max_wait is not None or self.ticks is not None or options.transforms is not None

    @property
    def held(self) -> tuple[int, ...]:
        """The inputs whose latest message is held: it may be in many sets."""
        return tuple(index for index in range(len(self.topics)) if self.options.repeats and index != self.trigger)

    @property
    def own_tolerances(self) -> tuple[Tolerance | None, ...]:
        """The tolerance that each input has instead of the group's; None for those that the group's is for."""
        return (None,) * len(self.topics) if self.options.distance is Distance.SPAN else self._own()

    @property
    def narrowed(self) -> tuple[Tolerance | None, ...]:
        """The tolerance that each input has beside the group's largest span; None for those that have none."""
        return self._own() if self.options.distance is Distance.SPAN else (None,) * len(self.topics)

    def _own(self) -> tuple[Tolerance | None, ...]:
        return tuple(None if each.tolerance == self.options.tolerance else each.tolerance for each in self.topics)

    def paths(self) -> Iterator[tuple[Path, TopicConfig]]:
        """Yield its topics, each with the place where it stands in the file."""
        for index, topic in enumerate(self.topics):
            yield (*self.path, "topics", index), topic

    def engine(self, chains: Chains | None = None) -> SyncGroup:
        """Return a new, empty engine of this group. Without `chains`, no set waits for transforms."""
        awaited = self.options.transforms
        return SyncGroup(
            self.options.build_policy(self.inputs),
            required=tuple(topic.required for topic in self.topics),
            quorum=self.quorum,
            max_wait_ns=self.options.max_wait,
            offsets_ns=tuple(topic.offset_ns for topic in self.topics),
            restamp=self.restamp,
            every=self.options.every,
            min_set_period_ns=self.options.max_rate,
            transforms=Transforms(chains, awaited.target, awaited.wait) if awaited and chains is not None else None,
            most_waiting=self.options.queue_size,
        )


def resolve_groups(file: FileKeys) -> tuple[GroupConfig, ...]:
    """Return the groups of a file with every default filled in."""
    groups = [_group(name, group, file.node) for name, group in file.groups.items()]
    types = {
        name: topic.type for group in reversed(groups) for name, topic in _named(group) if topic.topic and topic.type
    }
    return tuple(_with_types(group, types) for group in groups)


def _named(group: GroupConfig) -> Iterator[tuple[str, TopicConfig]]:
    return zip(group.inputs.names, group.topics, strict=True)


def _with_types(group: GroupConfig, types: Mapping[str, str]) -> GroupConfig:
    """Fill in types that another group gives for the same topic: all groups share its subscription."""
    topics = (
        topic if topic.type is not None else replace(topic, type=types.get(name)) for name, topic in _named(group)
    )
    return replace(group, topics=tuple(topics))


def resolve_listen(metrics: MetricsConfig | None) -> Listen | None:
    """Return where to listen for HTTP; None for nowhere."""
    if metrics is None:
        return None
    is_asked_for = metrics.listen is not None
    listen = Listen(DEFAULT_HOST, DEFAULT_PORTS) if metrics.listen is None else parse_listen(metrics.listen)
    share = None if metrics.ready is None else metrics.ready.share
    return replace(listen, is_asked_for=is_asked_for, hosts=metrics.hosts, ready_share=share)


def _group(name: str, group: Group, node: NodeConfig) -> GroupConfig:
    inputs = Inputs.of(group.topics, node)
    trigger = _index(group.trigger_topic, inputs)
    return GroupConfig(
        name=name,
        topics=tuple(
            _topic(topic, group, name=name, is_trigger=index == trigger) for index, topic in enumerate(group.topics)
        ),
        restamp=_restamp(group, inputs),
        trigger=trigger,
        options=group,
        inputs=inputs,
        bundle=_bundle(group.bundle, inputs),
    )


def _bundle(bundle: BundleKeys | None, inputs: Inputs) -> BundleConfig | None:
    if bundle is None:
        return None
    by_input = {inputs.node.absolute(topic): field for field, topic in bundle.fields.items()}
    return BundleConfig(bundle.topic, bundle.type, tuple(by_input.get(name) for name in inputs.names), bundle.qos)


def _topic(topic: Topic, group: Group, *, name: str, is_trigger: bool) -> TopicConfig:
    output = default_output(topic.topic, group=name, prefix=group.output_prefix)
    if topic.output is not None:
        output = topic.output
    if group.bundle is not None and not group.outputs:
        output = group.bundle.topic
    in_quorum = group.quorum is not None and topic.required is None and not is_trigger
    return TopicConfig(
        topic=topic.topic,
        type=topic.type,
        output=output,
        qos=topic.qos,
        offset_ns=topic.offset,
        min_period_ns=topic.min_period if isinstance(topic, PacedTopic) else 0,
        stamp=topic.stamp,
        required=topic.required is True or (topic.required is None and not in_quorum),
        in_quorum=in_quorum,
        key=group.key_of(topic),
        tolerance=group.tolerance_of(topic),
        is_of_device=topic.clock == "device",
        delay_ns=topic.delay,
    )


def _restamp(group: Group, inputs: Inputs) -> Restamp | int | None:
    match group.restamp:
        case "none":
            return None
        case "earliest":
            return Restamp.EARLIEST
        case "latest":
            return Restamp.LATEST
        case "trigger" if group.ticks is not None:
            return Restamp.TICK
        case "trigger" if group.trigger_topic is not None:
            return _index(group.trigger_topic, inputs)
        case topic:
            return _index(topic, inputs)


def _index(topic: str | None, inputs: Inputs) -> int | None:
    try:
        return None if topic is None else inputs.index_of(topic)
    except ValueError:
        return None
