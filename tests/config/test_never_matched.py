"""Keys that together never give a set: such a file is refused, and of each that is accepted the engine gives sets."""

import json
import random
from typing import Any

import pytest

from syncrelay.config import ConfigError, GroupConfig, load_text
from syncrelay.sync import Match, Message
from tests.faults.extent import chosen

_SLOP_POLICIES = ("approximate_time", "approximate_time_eager", "approximate_epsilon_time")
_PERIOD = 100_000_000
_DRAWN = chosen(short=100, long=4000)
_IMAGE = "sensor_msgs/msg/Image"
_TEXT_KEYS = {_IMAGE: "header.frame_id", "dock_msgs/msg/Status": "name"}
_OTHER_KEYS = {_IMAGE: "header.stamp", "dock_msgs/msg/Status": "level", "dock_msgs/msg/Trigger": "time"}


def _drawn(chance: random.Random) -> dict[str, Any]:
    names = ("/a", "/b", "/c")[: chance.randint(2, 3)]
    topics = [
        {"topic": name, "type": _IMAGE, **({"stamp": "receive"} if chance.random() < 0.4 else {})} for name in names
    ]
    near = chance.choice((0, 0.0, "0ms", "1us", "20ms"))
    match chance.choice(("exact_time", "latest_time", *_SLOP_POLICIES)):
        case "exact_time":
            keys: dict[str, Any] = {"policy": "exact_time"}
        case "latest_time":
            keys = {"policy": "latest_time", "trigger": chance.choice(names)}
            keys |= {} if chance.random() < 0.3 else {"max_age": near}
        case policy:
            keys = {"policy": policy, "slop": near}
    return {**keys, "topics": topics}


def _may_differ(group: dict[str, Any]) -> bool:
    """Whether stamps of a set may differ by a nanosecond, as the keys were drawn."""
    allowed = 0 if group["policy"] == "exact_time" else group.get("max_age", group.get("slop", "any"))
    return allowed not in (0, "0ms")


def _matches(group: GroupConfig) -> bool:
    """Whether sets leave where all is well: measured at once, received a nanosecond before or after."""
    engine = group.engine()
    sets = 0
    for number in range(1, 20):
        for index, topic in enumerate(group.topics):
            off = 0 if topic.stamp == "header" else 1 if index == group.trigger else -1
            outcomes = engine.add(Message(index, number * _PERIOD + off, None), now=number * _PERIOD)
            sets += sum(isinstance(each, Match) for each in outcomes)
    return sets > 0


def _problems(group: dict[str, Any], environ: dict[str, str]) -> list[tuple[str, str]]:
    try:
        config = load_text(json.dumps({"version": 1, "groups": {"g": group}}), environ=environ)
    except ConfigError as error:
        return [(problem.path, problem.code) for problem in error.problems]
    return [] if _matches(config.groups[0]) else [("groups.g", "gives no set")]


def test_a_time_of_arrival_is_refused_where_stamps_have_to_be_equal_and_nowhere_else(environ):
    refused = 0
    for seed in range(_DRAWN):
        group = _drawn(random.Random(seed))
        received = [index for index, topic in enumerate(group["topics"]) if "stamp" in topic]
        is_hopeless = bool(received) and not _may_differ(group)
        expected = [(f"groups.g.topics[{received[0]}].stamp", "conflict")] if is_hopeless else []
        assert _problems(group, environ) == expected, (seed, group)
        refused += is_hopeless
    assert _DRAWN / 4 < refused < _DRAWN * 3 / 4


def test_keys_of_which_one_is_text_and_another_is_not_are_refused_and_no_others(environ):
    refused = 0
    for seed in range(_DRAWN):
        chance = random.Random(seed)
        keys = [chance.choice((_TEXT_KEYS, _OTHER_KEYS)) for _ in range(chance.randint(2, 3))]
        chosen = [chance.choice(list(each.items())) for each in keys]
        topics = [
            {"topic": f"/t{number}", "type": type_name, "key": key, "stamp": "receive"}
            for number, (type_name, key) in enumerate(chosen)
        ]
        are_mixed = any(each is not keys[0] for each in keys)
        text = json.dumps({"version": 1, "groups": {"g": {"policy": "equal_key", "topics": topics}}})
        if are_mixed:
            with pytest.raises(ConfigError, match="they are never equal"):
                load_text(text, environ=environ)
        else:
            load_text(text, environ=environ)
        refused += are_mixed
    assert _DRAWN / 3 < refused < _DRAWN * 5 / 6
