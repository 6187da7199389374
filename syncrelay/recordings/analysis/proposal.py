"""Files for topics of which nothing is known: groups, types and values as measured, the evidence as comments."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import yaml

from syncrelay.config import load_text
from syncrelay.config.wording import counted, did_you_mean
from syncrelay.errors import BagError, NothingToMatchError, UsageError
from syncrelay.explain import words
from syncrelay.printable import printable
from syncrelay.recordings.analysis.analysis import analyze_group, group_of
from syncrelay.recordings.analysis.changes import with_changes, with_evidence
from syncrelay.recordings.analysis.inventory import FEWEST, Topic, inventory
from syncrelay.recordings.analysis.pairs import pair
from syncrelay.recordings.bag.bindings import GroupBinding, bind
from syncrelay.recordings.bag.definitions import begins_with_header
from syncrelay.recordings.bag.recording import Channel, Recording

# Topics of one rate whose stamps lie within a tenth of a period of each other come from one epoch.
_TOGETHER: Final = 0.1
_SAME_RATE: Final = 1.1
_EPOCH: Final = "epoch"
_FUSED: Final = "fused"
_MATCHED: Final = "matched"
_HEAD: Final = "version: 1\ngroups:\n"


@dataclass(frozen=True, slots=True)
class Proposal:
    """The text of a file, and of each topic that it leaves out why, a sentence each."""

    text: str
    left_out: tuple[str, ...]


def proposed_text(name: str, channels: Sequence[Channel]) -> str:
    """Return a file's text with one group of channels, and values that stand until better ones are measured."""
    topics = [{"topic": channel.topic, "type": channel.type} for channel in channels]
    for topic, channel in zip(topics, channels, strict=True):
        if begins_with_header(channel) is False:
            topic["stamp"] = "receive"
    group = {"policy": "approximate_time", "slop": "10ms", "topics": topics}
    return yaml.safe_dump({"version": 1, "groups": {name: group}}, sort_keys=False)


def bind_file_or_topics(
    recording: Recording, *, file: str | None, text: str | None, topics: Sequence[str]
) -> tuple[str, tuple[GroupBinding, ...]]:
    """Return the text of a file and its groups as the recording fills them; without a text, one proposed for topics.

    Raises ConfigError for a faulty file, BagError for a topic that is not recorded, UsageError for fewer than two.
    """
    if text is None:
        by_name = {channel.topic: channel for channel in recording.channels}
        for topic in topics:
            if topic not in by_name:
                raise BagError(
                    f"{topic} is not in the recording{did_you_mean(topic, by_name)}; it has {', '.join(by_name)}"
                )
        if len(set(topics)) < 2:  # noqa: PLR2004  one alone has nothing to be matched with
            raise UsageError("name 2 topics or more")
        text = proposed_text(_MATCHED, [by_name[topic] for topic in dict.fromkeys(topics)])
    return text, bind(load_text(text, name=file or "<topics>"), recording)


def propose(recording: Recording) -> Proposal:
    """Read a recording to its end and return a file that gives sets of it, as propose_for does."""
    return propose_for(inventory(recording), source="the recording")


def propose_for(topics: Sequence[Topic], *, source: str) -> Proposal:
    """Return a file that gives sets of topics with stamps; `source` says what they were measured in.

    Topics that one driver stamps together become a group each, and one topic of each of those and all others one
    more. Raises NothingToMatchError, with what there is, where there are no two topics to match.
    """
    epochs = list(_epochs([topic for topic in topics if topic.unfit is None]))
    together = [epoch for epoch in epochs if len(epoch) > 1]
    groups = {f"{_EPOCH}_{number}": epoch for number, epoch in enumerate(together, start=1)}
    if len(epochs) > 1:
        groups[_FUSED] = [epoch[0] for epoch in epochs]
    if not groups:
        raise _nothing(
            f"no two topics of {source} have stamps and at least {FEWEST} messages: there is nothing to match", topics
        )
    texts = {name: text for name, members in groups.items() if (text := _measured(name, members, source))}
    if not texts:
        raise _nothing(f"no two topics of {source} form a set", topics)
    taken = {topic.channel for name in texts for topic in groups[name]}
    left_out = tuple(_left_out(topic) for topic in topics if topic.channel not in taken)
    return Proposal(_HEAD + "".join(text.removeprefix(_HEAD) for text in texts.values()), left_out)


def _nothing(why: str, topics: Sequence[Topic]) -> NothingToMatchError:
    return NothingToMatchError("\n  ".join([why, *(printable(_left_out(topic)) for topic in topics)]))


def _left_out(topic: Topic) -> str:
    channel = topic.channel
    why = topic.unfit or f"none of its {counted(topic.figures.messages, 'message')} forms a set with the others"
    return f"{channel.topic} ({channel.type or 'a type without a name'}): {why}"


def _epochs(topics: Sequence[Topic]) -> Iterator[list[Topic]]:
    """Yield topics that are stamped together, the slowest first."""
    left = sorted(topics, key=lambda each: each.figures.rate_hz)
    while left:
        first, *rest = left
        epoch = [first, *(each for each in rest if _are_together(first, each))]
        yield epoch
        left = [each for each in rest if each not in epoch]


def _are_together(first: Topic, second: Topic) -> bool:
    """Tell whether two topics, the slower first, run at one rate and are stamped at one time."""
    found = pair(first.stream, second.stream, (0, 0))
    if found is None or second.figures.rate_hz > _SAME_RATE * first.figures.rate_hz:
        return False
    return found.distance.high <= _TOGETHER * (first.figures.period or 0)


def _measured(name: str, members: Sequence[Topic], source: str) -> str | None:
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


def _evidence(topic: Topic) -> str:
    figures = topic.figures
    said = [words.rate(figures.rate_hz)]
    if figures.delay is not None:
        said.append(f"received {words.earlier(-figures.delay.median)} the stamp")
    said += [counted(figures.gaps, "gap")] if figures.gaps else []
    said += [f"{figures.duplicates} repeated"] if figures.duplicates else []
    said += sorted({profile.reliability for profile in topic.channel.qos})
    return ", ".join(said)
