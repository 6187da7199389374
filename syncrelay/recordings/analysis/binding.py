"""The groups that a recording is measured with: those of a file, or some of its topics as one group."""

from collections.abc import Sequence
from typing import Final

from syncrelay.config import load_text
from syncrelay.config.wording import did_you_mean
from syncrelay.errors import BagError, UsageError
from syncrelay.recordings.analysis.analysis import proposed_text
from syncrelay.recordings.bag import Channel, Recording
from syncrelay.recordings.bag.bindings import GroupBinding, bind

_GROUP: Final = "matched"


def bind_file_or_topics(
    recording: Recording, *, file: str | None, text: str | None, topics: Sequence[str]
) -> tuple[str, tuple[GroupBinding, ...]]:
    """Return the text of a file and its groups as the recording fills them; without a text, one proposed for topics.

    Raises ConfigError for a faulty file, BagError for a topic that is not recorded, UsageError for fewer than two.
    """
    if text is None:
        text = _proposed(recording, topics)
    return text, bind(load_text(text, name=file or "<topics>"), recording)


def _proposed(recording: Recording, topics: Sequence[str]) -> str:
    by_name: dict[str, Channel] = {channel.topic: channel for channel in recording.channels}
    for topic in topics:
        if topic not in by_name:
            raise BagError(
                f"{topic} is not in the recording{did_you_mean(topic, by_name)}; it has {', '.join(by_name)}"
            )
    if len(set(topics)) < 2:  # noqa: PLR2004  one alone has nothing to be matched with
        raise UsageError("name 2 topics or more")
    return proposed_text(_GROUP, [by_name[topic] for topic in dict.fromkeys(topics)])
