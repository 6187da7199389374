"""Which channels of a recording fill which inputs of a file, and what does not fit."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from syncrelay.config import Config, GroupConfig, TopicConfig
from syncrelay.config.names import expand
from syncrelay.config.wording import all_of, nearest, quoted
from syncrelay.recordings.bag.recording import Channel, Encoding, Recording

_MOST_LISTED = 8


@dataclass(frozen=True, slots=True)
class Input:
    """One input of a group: its full name, that of its output, and the channels that fill it."""

    config: TopicConfig
    topic: str
    output: str
    channels: tuple[Channel, ...]


@dataclass(frozen=True, slots=True)
class GroupBinding:
    """A group, its inputs in the file's order, and a sentence for each input without a channel.

    Types that the file leaves out are those of the recording, if it has exactly one.
    """

    group: GroupConfig
    inputs: tuple[Input, ...]
    problems: tuple[str, ...]

    @property
    def is_complete(self) -> bool:
        """Whether every required input, and enough of the others, have a channel, so that sets are possible."""
        have = [len(each.channels) for each in self.inputs]
        return all(have[index] for index in self.group.enough(have))


def bind(config: Config, recording: Recording) -> tuple[GroupBinding, ...]:
    """Return the binding of each group, in the file's order."""
    return tuple(_bind(group, config, recording.channels) for group in config.groups)


def full_name(topic: str, config: Config) -> str:
    """Return the absolute name that the file's node gives a topic."""
    return expand(topic, node=config.node.name, namespace=config.node.namespace)


def _bind(group: GroupConfig, config: Config, channels: Sequence[Channel]) -> GroupBinding:
    bound = [_bind_topic(topic, config, channels) for topic in group.topics]
    inputs = tuple(each for each, _ in bound)
    problems = dict.fromkeys(f"{group.name}: {problem}" for _, problems in bound for problem in problems)
    return GroupBinding(replace(group, topics=tuple(each.config for each in inputs)), inputs, tuple(problems))


def _bind_topic(topic: TopicConfig, config: Config, channels: Sequence[Channel]) -> tuple[Input, list[str]]:
    """Return an input, and why channels of its topic are missing or do not fit."""
    name, output = full_name(topic.topic, config), full_name(topic.output, config)
    found = tuple(channel for channel in channels if channel.topic == name)
    if not found:
        return Input(topic, name, output, ()), [_missing(name, channels)]
    if topic.type is None:
        types = list(dict.fromkeys(channel.type for channel in found if channel.type and _is_ros(channel)))
        if len(types) > 1:
            which = "and the file has no type for it: write the one that is meant"
            return Input(topic, name, output, ()), [f"{name} is recorded as {all_of(types)}, {which}"]
        topic = replace(topic, type=next(iter(types), None))
    fitting = tuple(channel for channel in found if channel.type == topic.type and _is_ros(channel))
    misfits = [_misfit(channel, topic) for channel in found if channel not in fitting]
    return Input(topic, name, output, fitting), misfits


def _is_ros(channel: Channel) -> bool:
    return isinstance(channel.encoding, Encoding)


def _misfit(channel: Channel, topic: TopicConfig) -> str:
    if not _is_ros(channel):
        return f"{channel.topic} is recorded as {channel.encoding or 'bytes without a named encoding'}, expected cdr"
    expected = "and the file has no type for it either" if topic.type is None else f"the file says {topic.type}"
    return f"{channel.topic} is recorded as {channel.type or 'a type without a name'}, {expected}"


def _missing(name: str, channels: Sequence[Channel]) -> str:
    topics = list(dict.fromkeys(channel.topic for channel in channels))
    close = nearest(name, topics)
    if close is not None:
        return f"{name} is not in the recording, did you mean {quoted(close)}?"
    more = ", ..." if len(topics) > _MOST_LISTED else ""
    return f"{name} is not in the recording, it has {', '.join(topics[:_MOST_LISTED]) or 'no topics'}{more}"
