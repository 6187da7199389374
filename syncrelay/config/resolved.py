"""What the relay is told: a file with every default filled in."""

from dataclasses import dataclass, field, replace

from syncrelay.config.file import FileKeys
from syncrelay.config.listen import DEFAULT_HOST, DEFAULT_PORTS, Listen, parse_listen
from syncrelay.config.models import (
    DiagnosticsConfig,
    KeyedTopic,
    MetricsConfig,
    NodeConfig,
    PacedTopic,
    StampSource,
    Topic,
)
from syncrelay.config.names import default_output
from syncrelay.config.names_in_graph import NamesInFile
from syncrelay.config.policies import AnyGroup, EqualKeyGroup, Inputs
from syncrelay.config.problems import Problem
from syncrelay.config.qos import QosOverrides, QosPreset
from syncrelay.sync import Restamp, SyncGroup


@dataclass(frozen=True, slots=True)
class TopicConfig:
    """An input and its output.

    `stamp` is "header", "receive" or a StampField with the path of the field; `key` the path of the field to
    match by, None where stamps are matched.
    """

    topic: str
    type: str
    output: str
    qos: QosPreset | QosOverrides
    offset_ns: int
    min_period_ns: int
    stamp: StampSource
    required: bool
    key: str | None


@dataclass(frozen=True, slots=True)
class GroupConfig:
    """A group. `restamp` is the engine's: None, one of Restamp, or an input's index."""

    name: str
    topics: tuple[TopicConfig, ...]
    restamp: Restamp | int | None
    options: AnyGroup
    inputs: Inputs

    def engine(self) -> SyncGroup:
        """Return a new, empty engine of this group."""
        return SyncGroup(
            self.options.build_policy(self.inputs),
            required=tuple(topic.required for topic in self.topics),
            max_wait_ns=self.options.max_wait,
            offsets_ns=tuple(topic.offset_ns for topic in self.topics),
            restamp=self.restamp,
            every=self.options.every,
            min_set_period_ns=self.options.max_rate,
        )


@dataclass(frozen=True, slots=True)
class Config:
    """A file that is in order. `notes` say what could not be checked, or is hardly meant.

    `names` tells what is wrong with it once remaps have made others of its topics' names.
    `listen` is None where no HTTP, `diagnostics` where nothing about the relay is published.
    """

    node: NodeConfig
    groups: tuple[GroupConfig, ...]
    listen: Listen | None
    diagnostics: DiagnosticsConfig | None
    names: NamesInFile = field(compare=False, repr=False)
    notes: tuple[Problem, ...] = ()


def resolve(file: FileKeys, *, names: NamesInFile, notes: tuple[Problem, ...]) -> Config:
    """Return a validated file with every default filled in."""
    groups = tuple(_group(name, group, file.node) for name, group in file.groups.items())
    return Config(file.node, groups, _listen(file.metrics), file.diagnostics, names, notes)


def _listen(metrics: MetricsConfig | None) -> Listen | None:
    if metrics is None:
        return None
    if metrics.listen is None:
        return Listen(DEFAULT_HOST, DEFAULT_PORTS, is_asked_for=False, hosts=metrics.hosts)
    return replace(parse_listen(metrics.listen), hosts=metrics.hosts)


def _group(name: str, group: AnyGroup, node: NodeConfig) -> GroupConfig:
    prefix = f"/{name}" if group.output_prefix is None else group.output_prefix
    inputs = Inputs.of(group.topics, node)
    return GroupConfig(
        name=name,
        topics=tuple(_topic(topic, group, prefix=prefix) for topic in group.topics),
        restamp=_restamp(group.restamp, inputs),
        options=group,
        inputs=inputs,
    )


def _topic(topic: Topic, group: AnyGroup, *, prefix: str) -> TopicConfig:
    return TopicConfig(
        topic=topic.topic,
        type=topic.type,
        output=topic.output or default_output(topic.topic, prefix=prefix),
        qos=topic.qos,
        offset_ns=topic.offset,
        min_period_ns=topic.min_period if isinstance(topic, PacedTopic) else 0,
        stamp=topic.stamp,
        required=topic.required,
        key=(topic.key or group.key) if isinstance(topic, KeyedTopic) and isinstance(group, EqualKeyGroup) else None,
    )


def _restamp(word: str, inputs: Inputs) -> Restamp | int | None:
    match word:
        case "none":
            return None
        case "earliest":
            return Restamp.EARLIEST
        case "latest":
            return Restamp.LATEST
        case topic:
            return inputs.index_of(topic)
