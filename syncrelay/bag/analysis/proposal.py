"""A file for topics of which nothing is known: groups, types and values as measured, the evidence as comments."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from syncrelay.bag.analysis.analysis import analyze_group, group_of, proposed_text
from syncrelay.bag.analysis.changes import with_changes, with_evidence
from syncrelay.bag.analysis.nearest import pair
from syncrelay.bag.analysis.streams import Stream, read_streams
from syncrelay.bag.analysis.topics import TopicFigures, figures_of
from syncrelay.bag.definitions import begins_with_header
from syncrelay.bag.recording import Channel, Encoding, Recording
from syncrelay.bag.wiring import wire
from syncrelay.config import Severity, load_text
from syncrelay.config.names import check_topic_name
from syncrelay.config.typenames import check_type_name
from syncrelay.errors import NothingToMatchError
from syncrelay.explain import words

# Fewer messages tell nothing of a rhythm.
_FEWEST: Final = 10
# Topics of one rate whose stamps lie within a tenth of a period of each other come from one epoch.
_TOGETHER: Final = 0.1
_SAME_RATE: Final = 1.1
# Stamped, but of nodes, not of the world.
_OF_NO_SENSOR: Final = ("diagnostic_msgs/msg/DiagnosticArray",)
_EPOCH: Final = "epoch"
_FUSED: Final = "fused"
_HEAD: Final = "version: 1\ngroups:\n"


@dataclass(frozen=True, slots=True)
class _Topic:
    """A topic that can be matched, and what is measured of it."""

    channel: Channel
    stream: Stream
    figures: TopicFigures


def propose(recording: Recording) -> str:
    """Read a recording to its end and return the text of a file that gives sets of it, as propose_for does."""
    return propose_for(_recorded(recording), source="the recording")


def propose_for(streams: Sequence[tuple[Channel, Stream]], *, source: str) -> str:
    """Return the text of a file that gives sets of topics with headers; `source` says what they were measured in.

    Topics that one driver stamps together become a group each, and one topic of each of those and all others one
    more. Raises NothingToMatchError where there are no two topics to match.
    """
    topics = list(_measurable(streams))
    epochs = list(_epochs(topics))
    together = [epoch for epoch in epochs if len(epoch) > 1]
    groups = {f"{_EPOCH}_{number}": epoch for number, epoch in enumerate(together, start=1)}
    if len(epochs) > 1:
        groups[_FUSED] = [epoch[0] for epoch in epochs]
    if not groups:
        raise NothingToMatchError(
            f"no two topics of {source} have stamps and {_FEWEST} messages or more: there is nothing to match"
        )
    texts = [text for name, members in groups.items() if (text := _measured(name, members, source))]
    if not texts:
        raise NothingToMatchError(f"no two topics of {source} give a set")
    return _HEAD + "".join(text.removeprefix(_HEAD) for text in texts)


def _recorded(recording: Recording) -> list[tuple[Channel, Stream]]:
    channels = {
        channel.topic: channel
        for channel in recording.channels
        if isinstance(channel.encoding, Encoding) and _has_ros_names(channel) and begins_with_header(channel)
    }
    if len(channels) < 2:  # noqa: PLR2004  one alone has nothing to be matched with
        return []
    text = proposed_text("all", list(channels.values()))
    (streams,) = read_streams(recording, wire(load_text(text, package_missing=Severity.NOTE), recording))
    return [(channels[stream.topic], stream) for stream in streams]


def _has_ros_names(channel: Channel) -> bool:
    """Tell whether a file may name a channel: not all who write recordings keep to ROS's rules."""
    try:
        check_topic_name(channel.topic)
        check_type_name(channel.type)
    except ValueError:
        return False
    return True


def _measurable(streams: Sequence[tuple[Channel, Stream]]) -> Iterator[_Topic]:
    for channel, stream in streams:
        figures = figures_of(stream)
        is_stamped = figures.messages - figures.unstamped >= _FEWEST and figures.period
        if is_stamped and channel.type not in _OF_NO_SENSOR:
            yield _Topic(channel, stream, figures)


def _epochs(topics: Sequence[_Topic]) -> Iterator[list[_Topic]]:
    """Yield topics that are stamped together, the slowest first."""
    left = sorted(topics, key=lambda each: each.figures.rate_hz)
    while left:
        first, *rest = left
        epoch = [first, *(each for each in rest if _are_together(first, each))]
        yield epoch
        left = [each for each in rest if each not in epoch]


def _are_together(first: _Topic, second: _Topic) -> bool:
    """Tell whether two topics, the slower first, run at one rate and are stamped at one time."""
    found = pair(first.stream, second.stream, (0, 0))
    if found is None or second.figures.rate_hz > _SAME_RATE * first.figures.rate_hz:
        return False
    return found.distance.high <= _TOGETHER * (first.figures.period or 0)


def _measured(name: str, members: Sequence[_Topic], source: str) -> str | None:
    """Return the text of a file with one group and the values that fit, None where it gives no set."""
    text = proposed_text(name, [each.channel for each in members])
    streams = tuple(each.stream for each in members)
    suggestion = analyze_group(group_of(text, name), streams, text).suggestion
    if not suggestion.then:
        return None
    changed = with_changes(text, suggestion.changes)
    sets = f"{suggestion.then} of {suggestion.possible} possible sets of {source}"
    hints = "".join(f"    # {hint}\n" for hint in suggestion.hints)
    told = changed.replace(f"  {name}:\n", f"  {name}:  # {sets}\n{hints}", 1)
    return with_evidence(told, name, [_evidence(each) for each in members])


def _evidence(topic: _Topic) -> str:
    figures = topic.figures
    said = [words.rate(figures.rate_hz)]
    if figures.delay is not None:
        said.append(f"received {words.duration(figures.delay.median)} after the stamp")
    said += [f"{count} {word}" for count, word in ((figures.gaps, "gaps"), (figures.duplicates, "repeated")) if count]
    said += sorted({profile.reliability for profile in topic.channel.qos})
    return ", ".join(said)
