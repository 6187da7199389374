"""What the relay is told: a file with every default filled in."""

from dataclasses import dataclass

from syncrelay.config.file import FileKeys
from syncrelay.config.models import NodeConfig, PacedTopic, StampSource, Topic
from syncrelay.config.names import default_output, expand
from syncrelay.config.policies import AnyGroup
from syncrelay.config.problems import Problem
from syncrelay.config.qos import QosOverrides, QosPreset
from syncrelay.sync import Restamp, SyncGroup


@dataclass(frozen=True, slots=True)
class TopicConfig:
    """An input and its output. `stamp` is "header", "receive" or a StampField with the path of the field."""

    topic: str
    type: str
    output: str
    qos: QosPreset | QosOverrides
    offset_ns: int
    min_period_ns: int
    stamp: StampSource


@dataclass(frozen=True, slots=True)
class GroupConfig:
    """A group. `restamp` is the engine's: None, one of Restamp, or an input's index."""

    name: str
    topics: tuple[TopicConfig, ...]
    restamp: Restamp | int | None
    keys: AnyGroup

    def engine(self) -> SyncGroup:
        """Return a new, empty engine of this group."""
        return SyncGroup(
            self.keys.matcher(),
            required=(True,) * len(self.topics),
            max_wait_ns=None,
            offsets_ns=tuple(topic.offset_ns for topic in self.topics),
            restamp=self.restamp,
        )


@dataclass(frozen=True, slots=True)
class Config:
    """A file that is in order. `notes` say what could not be checked."""

    node: NodeConfig
    groups: tuple[GroupConfig, ...]
    notes: tuple[Problem, ...] = ()


def resolve(file: FileKeys, *, notes: tuple[Problem, ...]) -> Config:
    """Return a validated file with every default filled in."""
    groups = tuple(_group(name, group, file.node) for name, group in file.groups.items())
    return Config(file.node, groups, notes)


def _group(name: str, group: AnyGroup, node: NodeConfig) -> GroupConfig:
    prefix = f"/{name}" if group.output_prefix is None else group.output_prefix
    return GroupConfig(
        name=name,
        topics=tuple(_topic(topic, prefix=prefix) for topic in group.topics),
        restamp=_restamp(group, node),
        keys=group,
    )


def _topic(topic: Topic, *, prefix: str) -> TopicConfig:
    return TopicConfig(
        topic=topic.topic,
        type=topic.type,
        output=topic.output or default_output(topic.topic, prefix=prefix),
        qos=topic.qos,
        offset_ns=topic.offset,
        min_period_ns=topic.min_period if isinstance(topic, PacedTopic) else 0,
        stamp=topic.stamp,
    )


def _restamp(group: AnyGroup, node: NodeConfig) -> Restamp | int | None:
    match group.restamp:
        case "none":
            return None
        case "earliest" | "latest":
            return Restamp(group.restamp)
        case topic:
            inputs = [_absolute(each.topic, node) for each in group.topics]
            return inputs.index(_absolute(topic, node))


def _absolute(topic: str, node: NodeConfig) -> str:
    return expand(topic, node=node.name, namespace=node.namespace)
