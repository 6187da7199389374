"""A set or a drop as a line of JSON, for programs. All times and durations are nanoseconds."""

from collections.abc import Sequence
from typing import Any

from syncrelay.config import GroupConfig
from syncrelay.explain.report import RecentDrop


def set_line(
    group: GroupConfig, topics: Sequence[str], stamps: Sequence[int | None], *, left: int, received: int
) -> dict[str, Any]:
    """Return the line of a set, as what json.dumps takes; `received` is when its last message was.

    `stamps` are as they came; they are matched with the `offsets` of the inputs that have one, and `span` is that of
    the sums. `latency` is how long the set waited since its last message was received. `topics` are the inputs' full
    names.
    """
    pairs = zip(stamps, group.topics, strict=True)
    matched = [stamp + topic.offset_ns for stamp, topic in pairs if stamp is not None]
    named = dict(zip(topics, stamps, strict=True))
    return {
        "group": group.name,
        "time": left,
        "stamps": named,
        "offsets": {name: topic.offset_ns for name, topic in zip(topics, group.topics, strict=True) if topic.offset_ns},
        "span": max(matched) - min(matched),
        "latency": left - received,
        "missing": [topic for topic, stamp in named.items() if stamp is None],
    }


def drop_line(
    group: GroupConfig, topics: Sequence[str], drop: RecentDrop, *, left: int, received: int
) -> dict[str, Any]:
    """Return the line of a message that leaves unmatched, as `set_line` does."""
    return {
        "group": group.name,
        "time": left,
        "topic": topics[drop.input],
        "stamp": drop.stamp,
        "received": received,
        "reason": drop.reason.value,
    }
