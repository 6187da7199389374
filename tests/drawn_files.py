"""Files that are in order, drawn by a seed from the models themselves, and recordings that fit a file.

A key that a model gets is drawn without being named here, with the values of its own `examples`. What an example names,
such as the input of `trigger`, is replaced by what the drawn group has.
"""

import random
import types
import typing
from collections.abc import Iterator
from typing import Any

import numpy as np
import yaml
from rosbags.interfaces import Nodetype

from syncrelay.config import Config, ConfigError, load_text
from syncrelay.config.keys import Keys
from syncrelay.config.policies import GROUP_MODELS
from tests.ros.cdr_messages import NS_PER_SECOND, STORE, VECTOR, header, time
from tests.ros.frames import Frame

_BEGIN = 1_700_000_000 * NS_PER_SECOND
_LASTS = 2 * NS_PER_SECOND
_HEADER = "std_msgs/msg/Header"
_TIME = "builtin_interfaces/msg/Time"


def drawn_files(seed: str) -> Iterator[str]:
    """Yield one file in order after another: each policy in turn, with one required input first."""
    rng = random.Random(seed)
    number = 0
    while True:
        model = GROUP_MODELS[number % len(GROUP_MODELS)]
        inputs = rng.randint(2, 4)
        required = 1 if number < 2 * len(GROUP_MODELS) else rng.randint(1, inputs)
        for _ in range(1_000):
            text = yaml.safe_dump({"version": 1, "groups": {"drawn": _group(rng, model, inputs, required)}})
            try:
                load_text(text)
            except ConfigError:
                continue  # Keys that must not stand together, of which the file's own checks know.
            yield text
            break
        else:
            raise AssertionError(f"no file of {model.__name__} with {inputs} inputs was in order")
        number += 1


def _group(rng: random.Random, model: Any, inputs: int, required: int) -> dict[str, Any]:
    names = [f"/in{index}" for index in range(inputs)]
    topic_model = typing.get_args(model.model_fields["topics"].annotation)[0]
    topics = [
        {
            **_keys(rng, topic_model, names, skip={"topic", "type", "output", "required"}),
            "topic": name,
            "type": VECTOR,
            **({} if index < required else {"required": False}),
        }
        for index, name in enumerate(names)
    ]
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
    return rng.choice(names) if isinstance(value, str) and value.startswith("/") and key != "output_prefix" else value


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
