"""Files that are in order, drawn by a seed from the models themselves; their parts, and recordings that fit one.

A key that a model gets is drawn without being named here, with the values of its own `examples`. What an example names,
such as the input of `trigger`, is replaced by what the drawn group has.
"""

import json
import random
import types
import typing
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
import yaml
from pydantic import BaseModel
from rosbags.interfaces import Nodetype

from syncrelay.config import Config, ConfigError, load_text
from syncrelay.config.file import FileKeys, file_format
from syncrelay.config.installed import topic_model
from syncrelay.config.keys import Keys
from syncrelay.config.models import Group, Topic
from syncrelay.config.policies import GROUP_MODELS
from tests.ros.cdr_messages import NS_PER_SECOND, STORE, VECTOR, header, time
from tests.ros.frames import Frame

_BEGIN = 1_700_000_000 * NS_PER_SECOND
_LASTS = 2 * NS_PER_SECOND
_HEADER = "std_msgs/msg/Header"
_TIME = "builtin_interfaces/msg/Time"
_SECTIONS = ("node", "metrics", "diagnostics")
_OF_INPUTS = {"topic", "type", "output", "required"}
# Keys whose examples look like inputs.
_NO_INPUTS = ("output_prefix", "namespace")


def models_of(kind: Any) -> Iterator[type[BaseModel]]:
    """Yield every model that a model has below it, and itself; some of them more than once."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        yield kind
        for field in kind.model_fields.values():
            yield from models_of(field.annotation)
    for part in typing.get_args(kind):
        yield from models_of(part)


def drawn_files(seed: str) -> Iterator[str]:
    """Yield one file in order after another: each policy in turn, with one required input first."""
    rng = random.Random(seed)
    number = 0
    while True:
        model = GROUP_MODELS[number % len(GROUP_MODELS)]
        names = [f"/in{index}" for index in range(rng.randint(2, 4))]
        required = 1 if number < 2 * len(GROUP_MODELS) else rng.randint(1, len(names))
        given: list[dict[str, Any]] = [{"topic": name, "type": VECTOR} for name in names]
        given[required:] = [{**topic, "required": False} for topic in given[required:]]
        yield yaml.safe_dump(_in_order(partial(_file_of_one, rng, model, given))[0])
        number += 1


def _file_of_one(rng: random.Random, model: type[Group], given: list[dict[str, Any]]) -> dict[str, Any]:
    return {"version": 1, "groups": {"drawn": _group(rng, model, given)}}


def any_file(rng: random.Random) -> tuple[dict[str, Any], Config]:
    """Return a file of three groups that share topics, with sections and `defaults`, and what it says."""
    return _in_order(partial(_file, rng))


def parts_of(keys: dict[str, Any], rng: random.Random) -> list[str]:
    """Return texts of files that have together what one has, each group and section in any of them."""
    parts: list[dict[str, Any]] = [{"version": 1} for _ in range(rng.randrange(2, 5))]
    for name in rng.sample(sorted(keys["groups"]), k=len(keys["groups"])):
        part = rng.choice(parts)
        part.setdefault("groups", {})[name] = keys["groups"][name]
        part |= {key: keys[key] for key in ("defaults",) if key in keys}
    for name in keys.keys() & _SECTIONS:
        rng.choice(parts)[name] = keys[name]
    return list(map(json.dumps, parts))


def _in_order(draw: Callable[[], dict[str, Any]]) -> tuple[dict[str, Any], Config]:
    """Draw until a file is in order: of keys that must not stand together its own checks know."""
    for _ in range(10_000):
        keys = draw()
        with suppress(ConfigError):
            return keys, load_text(json.dumps(keys))
    raise AssertionError("no drawn file was in order")


def _file(rng: random.Random) -> dict[str, Any]:
    names = ["a", "/b", "~/c", "/d/e", "f"]
    # All groups share the subscription of a topic. One of them may say its type for all.
    qos = {name: rng.choice(Topic.model_fields["qos"].examples or ()) for name in names}
    groups = {}
    for name in rng.sample(("one", "two", "three", "four"), k=3):
        model = rng.choice(GROUP_MODELS)
        given = [
            {"topic": topic, "qos": qos[topic]}
            | ({"type": VECTOR} if rng.random() < 0.7 else {})
            | ({"output": f"/out{rng.randrange(30)}"} if rng.random() < 0.2 else {})
            for topic in rng.sample(names, k=rng.randint(2, 3))
        ]
        groups[name] = _group(rng, model, given)
    sections = {
        name: None if value is types.NoneType else _keys(rng, value, names, skip=set())
        for name in _SECTIONS
        for value in rng.choices(_alternatives(FileKeys.model_fields[name].annotation))
        if rng.random() < 0.5
    }
    defaults = _keys(rng, file_format().defaults, [name], skip={"policy", "key"})
    return {"version": 1, **sections, "defaults": defaults, "groups": groups}


def _group(rng: random.Random, model: type[Group], given: list[dict[str, Any]]) -> dict[str, Any]:
    """Return a group of topics of which some keys are given."""
    names = [topic["topic"] for topic in given]
    topics = [{**_keys(rng, topic_model(model), names, skip=_OF_INPUTS), **topic} for topic in given]
    rng.shuffle(topics)
    return {**_keys(rng, model, names, skip={"topics"}), "topics": topics}


def _keys(rng: random.Random, model: type[Keys], names: list[str], *, skip: set[str]) -> dict[str, Any]:
    """Return the keys that are needed, and each of the others one time in five."""
    return {
        key: _value(rng, key, field, names)
        for key, field in model.model_fields.items()
        if key not in skip and (field.is_required() or key == "key" or rng.random() < 0.2)
    }


def _value(rng: random.Random, key: str, field: Any, names: list[str]) -> Any:
    literals = [each for each in _alternatives(field.annotation) if typing.get_origin(each) is typing.Literal]
    values = [*(field.examples or ()), *(value for each in literals for value in typing.get_args(each))]
    if bool in _alternatives(field.annotation):
        values = [True, False]
    assert values, f"`{key}` has no example to draw"
    value = rng.choice(values)
    if isinstance(value, str) and value.endswith("ms"):
        return rng.choice((value, value, "0ms", "1ms", "500ms", "3s"))
    if isinstance(value, int) and not isinstance(value, bool):
        return rng.choice((value, value, 1, 3, 40))
    if key == "stamp" and isinstance(value, dict):
        return {"field": "header.stamp"}
    if key == "key":
        return "header.frame_id"
    return rng.choice(names) if isinstance(value, str) and value.startswith("/") and key not in _NO_INPUTS else value


def _alternatives(annotation: Any) -> list[Any]:
    if typing.get_origin(annotation) is typing.Annotated:
        return _alternatives(typing.get_args(annotation)[0])
    if typing.get_origin(annotation) in (typing.Union, types.UnionType):
        return [each for one in typing.get_args(annotation) for each in _alternatives(one)]
    return [annotation]


def frames_for(config: Config, seed: str) -> list[Frame]:
    """Return two seconds of every input of a file whose type is known, each at a rate of its own."""
    rng = random.Random(seed)
    frames: list[Frame] = []
    inputs = {topic.topic: topic.type for group in config.groups for topic in group.topics}
    for name, type_name in inputs.items():
        if type_name not in STORE.fielddefs:
            continue
        period = round(NS_PER_SECOND / rng.choice((5, 10, 10, 20, 30, 50)))
        for number in range(_LASTS // period):
            stamp = _BEGIN + number * period + rng.randrange(period // 20)
            payload = bytes(STORE.serialize_cdr(_blank(type_name, stamp, f"n{number}"), type_name))
            frames.append(Frame(name, type_name, stamp + rng.randrange(5_000_000), payload))
    return sorted(frames, key=lambda frame: frame.time)


def _blank(name: str, stamp: int, text: str) -> Any:
    """A message of zeros with this stamp in each of its times, and this text in its frame."""
    if name == _HEADER:
        return header(stamp, text)
    if name == _TIME:
        return time(stamp)
    return STORE.types[name](*(_zero(kind, stamp, text) for _, kind in STORE.fielddefs[name][1]))


def _zero(kind: Any, stamp: int, text: str) -> Any:
    what, of = kind
    if what == Nodetype.NAME:
        return _blank(of, stamp, text)
    if what == Nodetype.BASE:
        return {"string": "", "bool": False}.get(of[0], 0)
    element, bound = of
    count = bound if what == Nodetype.ARRAY else 0
    if element[0] == Nodetype.BASE and element[1][0] != "string":
        return np.zeros(
            count, dtype={"byte": "int8", "octet": "int8", "char": "uint8"}.get(element[1][0], element[1][0])
        )
    return [_zero(element, stamp, text) for _ in range(count)]
