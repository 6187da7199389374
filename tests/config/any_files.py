"""Files that are in order, drawn at random, and the same in parts; and all models that a file is made of."""

import json
import random
from collections.abc import Iterator
from typing import Any, get_args

from pydantic import BaseModel

from syncrelay.config import Config, ConfigError, load_text

_TYPES = tuple(f"sensor_msgs/msg/{name}" for name in ("Imu", "Image", "Temperature"))
_NAMES = ("a", "/b", "~/c", "/d/e", "f")
_POLICIES = ("exact_time", "approximate_time", "approximate_time_eager", "approximate_epsilon_time")
_QOS = (None, "auto", "sensor_data", {"depth": 5}, {"reliability": "reliable"})
_ONCE: dict[str, tuple[dict[str, Any] | None, ...]] = {
    "node": ({}, {"namespace": "/r"}, {"name": "n", "coalesce": "1ms"}),
    "metrics": (None, {}, {"listen": "127.0.0.1:0"}),
    "diagnostics": (None, {}, {"scalars": True}),
}


def any_file(chance: random.Random, environ: dict[str, str]) -> tuple[dict[str, Any], Config]:
    """A file and what it says."""
    while True:
        keys = _file(chance)
        try:
            return keys, load_text(json.dumps(keys), environ=environ)
        except ConfigError:
            # Drawn anew: outputs that meet, a key that a policy does not have.
            continue


def models_of(kind: Any) -> Iterator[type[BaseModel]]:
    """Every model that a model has below it, and itself; some of them more than once."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        yield kind
        for field in kind.model_fields.values():
            yield from models_of(field.annotation)
    for part in get_args(kind):
        yield from models_of(part)


def parts_of(keys: dict[str, Any], chance: random.Random) -> list[str]:
    """The texts of files that have together what one has, each group and section in any of them."""
    parts: list[dict[str, Any]] = [{"version": 1} for _ in range(chance.randrange(2, 5))]
    for name in chance.sample(sorted(keys["groups"]), k=len(keys["groups"])):
        part = chance.choice(parts)
        part.setdefault("groups", {})[name] = keys["groups"][name]
        part |= {"defaults": keys["defaults"]}
    for name in _ONCE.keys() & keys.keys():
        chance.choice(parts)[name] = keys[name]
    return list(map(json.dumps, parts))


def _file(chance: random.Random) -> dict[str, Any]:
    types = {name: chance.choice(_TYPES) for name in _NAMES}
    qos = {name: chance.choice(_QOS) for name in _NAMES}
    defaults = _some(chance, 0.2, policy="approximate_time", manifest=False, max_wait="1s", **_options(chance))
    groups = {name: _group(chance, types, qos) for name in chance.sample(("one", "two", "three", "four"), k=3)}
    once = {name: chance.choice(values) for name, values in _ONCE.items() if chance.random() < 0.3}
    return {"version": 1, **once, "defaults": defaults, "groups": groups}


def _group(chance: random.Random, types: dict[str, str], qos: dict[str, Any]) -> dict[str, Any]:
    policy = chance.choice(_POLICIES)
    names = chance.sample(_NAMES, k=chance.randrange(2, 4))
    topics = [
        {"topic": name}
        # One group of several that have a topic may say its type for all.
        | _some(chance, 0.7, type=types[name])
        | ({} if qos[name] is None else {"qos": qos[name]})
        | _some(chance, 0.2, offset=f"{chance.randrange(9)}ms", stamp="receive", output=f"/out{chance.randrange(30)}")
        for name in names
    ]
    options = _options(chance) | {"restamp": chance.choice(["none", "latest", names[0]]), "output_prefix": "p"}
    slop = {} if policy == "exact_time" else {"slop": f"{chance.randrange(1, 9)}ms"}
    return {"policy": policy, "topics": topics, **slop, **_some(chance, 0.2, **options)}


def _options(chance: random.Random) -> dict[str, Any]:
    return {"queue_size": chance.randrange(2, 9), "every": chance.randrange(1, 4), "lazy": chance.random() < 0.5}


def _some(chance: random.Random, likelihood: float, **keys: Any) -> dict[str, Any]:
    return {key: value for key, value in keys.items() if chance.random() < likelihood}
