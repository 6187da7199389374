"""A set or a drop of a replay as a line of JSON, for programs. All times and durations are nanoseconds."""

import json

from syncrelay.bag.bindings import GroupBinding
from syncrelay.bag.replay import received
from syncrelay.sync import Drop, Match


def set_line(binding: GroupBinding, match: Match, now: int) -> str:
    """Return the line of a set that leaves at `now`.

    `span` is that of the stamps as they are matched, with the inputs' offsets. `latency` is how long the set waited
    since its last message was received.
    """
    topics = [each.topic for each in binding.inputs]
    messages = list(zip(topics, binding.inputs, match.messages, strict=True))
    there = [(each, message) for _, each, message in messages if message is not None]
    stamps = [message.stamp + each.config.offset_ns for each, message in there]
    line = {
        "group": binding.group.name,
        "time": now,
        "stamps": {topic: message.stamp if message else None for topic, _, message in messages},
        "span": max(stamps) - min(stamps),
        "latency": now - max(received(message) for _, message in there),
        "missing": [topic for topic, _, message in messages if message is None],
    }
    return json.dumps(line)


def drop_line(binding: GroupBinding, drop: Drop, now: int) -> str:
    """Return the line of a message that leaves unmatched at `now`."""
    message = drop.message
    line = {
        "group": binding.group.name,
        "time": now,
        "topic": binding.inputs[message.input].topic,
        "stamp": message.stamp,
        "received": received(message),
        "reason": drop.reason.value,
    }
    return json.dumps(line)
