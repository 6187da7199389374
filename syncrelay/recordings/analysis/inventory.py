"""What a recording holds, topic by topic, and of each whether a group can match it, or why it cannot."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from syncrelay.config.names import check_topic_name, check_type_name
from syncrelay.config.wording import counted
from syncrelay.recordings.analysis.streams import Stream, read_topics
from syncrelay.recordings.analysis.topics import TopicFigures, figures_of
from syncrelay.recordings.bag.definitions import begins_with_header, stamp_fields
from syncrelay.recordings.bag.recording import Channel, Definition, Encoding, Recording

FEWEST: Final = 10
"""Fewer messages tell nothing of a rhythm."""

# Stamped, but of nodes, not of the world.
_OF_NO_SENSOR: Final = ("diagnostic_msgs/msg/DiagnosticArray",)


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic and what is measured of it, by times of receipt where there are no stamps.

    `lack` says why none of its messages can be matched by a stamp, `unfit` why it is not proposed for a group, which
    may be for want of messages only; None where it can be.
    """

    channel: Channel
    stream: Stream
    figures: TopicFigures
    lack: str | None
    unfit: str | None


def inventory(recording: Recording) -> tuple[Topic, ...]:
    """Read a recording to its end and return its topics, in the order of their names."""
    return _topics([(channel, stream, _lack(channel)) for channel, stream in read_topics(recording)])


def inventory_of(streams: Sequence[tuple[Channel, Stream]]) -> tuple[Topic, ...]:
    """Return topics that are known to have stamps, in the order of their names."""
    return _topics([(channel, stream, None) for channel, stream in streams])


def _topics(read: Sequence[tuple[Channel, Stream, str | None]]) -> tuple[Topic, ...]:
    # Of a topic that was recorded as several types, the one with the most messages.
    fullest: dict[str, Stream] = {}
    for channel, stream, lack in read:
        if lack is None and len(stream.stamps) > len(fullest.get(channel.topic, Stream("", "")).stamps):
            fullest[channel.topic] = stream
    topics = [_topic(channel, stream, lack, fullest.get(channel.topic, stream)) for channel, stream, lack in read]
    return tuple(sorted(topics, key=lambda topic: (topic.channel.topic, topic.channel.type)))


def _topic(channel: Channel, stream: Stream, lack: str | None, fullest: Stream) -> Topic:
    figures = figures_of(stream)
    other = f"recorded as several types; most messages are {fullest.type}"
    unfit = lack or (None if fullest is stream else other) or _too_little(channel, figures)
    return Topic(channel, stream, figures, lack, unfit)


def _lack(channel: Channel) -> str | None:
    """Return why a file cannot name a channel, or a stamp not be read in it."""
    if not isinstance(channel.encoding, Encoding):
        return f"it is recorded as {channel.encoding or 'bytes without a named encoding'}, expected cdr"
    try:
        # Not all who write recordings keep to ROS's rules.
        check_topic_name(channel.topic)
        check_type_name(channel.type)
    except ValueError as error:
        return str(error)
    has_header = begins_with_header(channel)
    if has_header is None:
        return "the recording does not define its type, so nothing is known about its stamps"
    return None if has_header else no_header(channel.type, channel.definition)


def no_header(type_name: str, definition: Definition | None = None) -> str:
    """Return why a type that does not begin with a header is not matched, and by which of its fields it could be."""
    written = [f"`stamp: {{field: {name}}}`" for name in stamp_fields(type_name, definition)]
    if not written:
        return "its type has no header, so no stamp to match by"
    return f"its type does not begin with a header; to match by a field of it, write {' or '.join(written)}"


def _too_little(channel: Channel, figures: TopicFigures) -> str | None:
    """Return why nothing could be measured of a topic."""
    if channel.type in _OF_NO_SENSOR:
        return "it carries diagnostics, not sensor data"
    unset = figures.unstamped + figures.unreadable
    if figures.messages - unset >= FEWEST and figures.period:
        return None
    faults = ((figures.unstamped, "with stamp 0"), (figures.unreadable, "without a readable stamp"))
    said = [counted(figures.messages, "message"), *(f"{count} {what}" for count, what in faults if count)]
    if not unset and figures.messages >= FEWEST:
        said.append("all with the same stamp")
    elif not unset:
        said.append(f"at least {FEWEST} are needed")
    return ", ".join(said)
