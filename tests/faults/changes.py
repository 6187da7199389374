"""Files for a running relay, one after the other: faulty ones, and right ones whose topics change roles and types."""

import random
from collections.abc import Mapping
from typing import Any

from syncrelay.config import load_text
from syncrelay.errors import SyncRelayError
from tests.faults.mutations import mutated
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import LOSSLESS, config

_TYPES = tuple(f"sensor_msgs/msg/{name}" for name in ("Imu", "MagneticField", "Temperature"))
_TOPICS = ("/a", "/b", "/c", "/d", "/e", "/f")
_MORE_OUTPUTS = ("/g", "/h", "/i", "/j", "/k")
_POLICIES = ("exact_time", "approximate_time", "approximate_time_eager")
# What is subscribed to and published though nobody else does.
_AT_ONCE = (
    {"reliability": "reliable", "durability": "volatile"},
    {"reliability": "best_effort", "durability": "volatile"},
)
_LATCHED = {"reliability": "reliable", "durability": "transient_local"}


def right_groups(chance: random.Random, published: tuple[str, ...]) -> dict[str, Any]:
    """One to three groups that may stand in one file; of what is published, too, which are vectors."""
    types = {topic: chance.choice(_TYPES) for topic in chance.sample(_TOPICS, k=chance.randrange(2, 6))}
    qos = {topic: chance.choice(_AT_ONCE) for topic in types}
    outputs = [*(set(_TOPICS) - types.keys()), *_MORE_OUTPUTS]
    outputs.sort()
    chance.shuffle(outputs)
    groups: dict[str, Any] = {}
    for name in chance.sample(("one", "two", "three"), k=chance.randrange(1, 4)):
        chosen = chance.sample(sorted(types), k=2)
        topics: list[dict[str, Any]] = [
            {"topic": each, "type": types[each], "qos": qos[each], "output": outputs.pop()} for each in chosen
        ]
        if chance.random() < 0.5:
            # Fed in earnest, and shared with the group that stays.
            topics += [{"topic": chance.choice(published), "type": VECTOR, "qos": LOSSLESS}]
        deadline = {}
        if chance.random() < 0.5:
            # Sets leave because time passes, whatever becomes of the outputs at that moment.
            fed = [{"topic": each, "type": VECTOR, "qos": LOSSLESS} for each in published]
            topics = [{**each, "required": False} for each in topics[:2]] + fed
            deadline = {"max_wait": f"{chance.randrange(1, 30)}ms"}
        groups[name] = {
            **deadline,
            "policy": chance.choice(_POLICIES),
            "queue_size": chance.randrange(2, 100),
            "topics": topics,
        }
        if groups[name]["policy"] != "exact_time":
            groups[name]["slop"] = f"{chance.randrange(1, 50)}ms"
    return groups


def faulty(right: str, chance: random.Random) -> str:
    """A file with faults that are found."""
    while True:
        text = mutated(right.encode(), chance).decode(errors="replace")
        try:
            load_text(text)
        except SyncRelayError:
            return text


def change(
    chance: random.Random, staying: Mapping[str, Any], published: tuple[str, ...], **keys: Any
) -> tuple[str, bool]:
    """The next file, in which these groups stay as they are, and whether it is right."""
    right = config({**staying, **right_groups(chance, published)}, **keys)
    return (right, True) if chance.random() < 0.7 else (faulty(right, chance), False)
