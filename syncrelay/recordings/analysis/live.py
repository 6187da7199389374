"""What is observed live, kept as a recording's streams are: so that better values are found for it in the same way."""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

from syncrelay.config import Config, GroupConfig
from syncrelay.explain import Arrivals
from syncrelay.recordings.analysis.analysis import GroupAnalysis, analyze_group, group_of
from syncrelay.recordings.analysis.streams import Mapping, Stream

# Of all groups together, and of each one at least: the analysis takes some seconds for so many.
_MOST: Final = 50_000
_LEAST: Final = 2_000


class LiveStreams:
    """The last messages of groups, in the order of their arrival."""

    def __init__(self, groups: Sequence[GroupConfig]) -> None:
        most = max(_LEAST, _MOST // max(1, len(groups)))
        self._last = {group.name: deque[tuple[int, int, int]](maxlen=most) for group in groups}

    def take(self, group: str, arrivals: Sequence[Arrivals]) -> None:
        """Take stamps and times of receipt of each input's messages since this was last called."""
        came = ((index, stamp, received) for index, each in enumerate(arrivals) for stamp, received in each)
        self._last[group].extend(sorted(came, key=lambda message: message[2]))

    def streams(self, group: GroupConfig) -> tuple[Stream, ...]:
        """Give a group's messages, a stream for each input."""
        came: list[list[tuple[int, int, int]]] = [[] for _ in group.topics]
        for place, (index, stamp, received) in enumerate(self._last[group.name]):
            came[index].append((stamp, received, place))
        return tuple(
            replace(
                Stream.of(topic.topic, topic.type or "", messages), mapping=Mapping() if topic.is_of_device else None
            )
            for topic, messages in zip(group.topics, came, strict=True)
        )


def analyze_live(config: Config, groups: Sequence[GroupConfig], live: LiveStreams) -> Iterator[GroupAnalysis]:
    """Yield what groups of files make of what was observed, and the values that would fit.

    Not of a group that goes by other than stamps, as only these are observed.
    """
    document = config.names.document
    for group in groups:
        if not group.options.matched_by:
            text = document.sources[document.key_span(group.path).source].text
            of_text = group_of(text, group.name)
            yield analyze_group(of_text, live.streams(of_text), text)
