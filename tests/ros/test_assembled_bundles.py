"""Messages put together from serialized ones, against what rclpy serializes, of installed types and of built ones."""

import os
import random
import re
import struct
import sysconfig
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from multiprocessing import get_context
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from syncrelay.cdr_assembly import Assembler
from syncrelay.config.interfaces import Interfaces
from tests.faults.extent import chosen
from tests.recordings.datasets.drawn_messages import drawn_definitions, drawn_message
from tests.ros.cdr_messages import STORE
from tests.ros.made_messages import made

serialization = pytest.importorskip("rclpy.serialization", reason="rclpy is not installed")
types = pytest.importorskip("syncrelay.relay.types")

_COUNT = 1000


def test_a_thousand_drawn_messages_of_all_installed_types_with_messages_in_them_are_as_rclpy_serializes_them():
    interfaces = Interfaces.find({})
    assert interfaces is not None
    names = {name for package in interfaces.packages for name in interfaces.types(package)} & STORE.fielddefs.keys()
    wholes = {name: members for name in sorted(names) if (members := _members(types.import_type(name)))}
    assert len(wholes) > 60
    assert _compare(wholes, STORE, random.Random(32)) == wholes.keys()


def test_a_thousand_drawn_messages_of_drawn_types_are_as_rclpy_serializes_them(tmp_path_factory, monkeypatch):
    chance = random.Random(33)
    definitions = {}
    for number in range(chosen(short=1, long=12)):
        for name, text in drawn_definitions(chance).items():
            package = f"drawn_msgs/S{number}"
            own = re.sub(r"\bmade_msgs/", package, text)
            definitions[name.replace("made_msgs/msg/", package.replace("/", "/msg/"))] = own
    there = made(tmp_path_factory.getbasetemp().parent, definitions)
    for name, value in there.sourced(os.environ).items():
        monkeypatch.setenv(name, value)
    monkeypatch.syspath_prepend(sysconfig.get_path("purelib", vars={"base": str(there.prefix)}))
    # Libraries are looked for where a process was told to as it started.
    with ProcessPoolExecutor(1, get_context("spawn")) as process:
        assert process.submit(_compare_made, definitions).result() == {
            name for name in definitions if name.endswith("Set")
        }


def _compare_made(definitions: Mapping[str, str]) -> set[str]:
    store = get_typestore(Stores.ROS2_JAZZY)
    for name, text in definitions.items():
        store.register(get_types_from_msg(text, name))
    wholes = {name: _members(types.import_type(name)) for name in definitions if name.endswith("Set")}
    return _compare(wholes, store, random.Random(34))


def _compare(wholes: Mapping[str, Mapping[str, str]], store: Any, chance: random.Random) -> set[str]:
    """Put messages of these types together from some of their members; the types that were compared."""
    compared: set[str] = set()
    for number in range(_COUNT):
        name = sorted(wholes)[number % len(wholes)]
        message_type = types.import_type(name)
        expected, contents = message_type(), {}
        default = serialization.serialize_message(expected)
        for field, kind in wholes[name].items():
            if chance.random() < 0.8:
                payload = bytes(store.serialize_cdr(drawn_message(store, kind, chance), kind))
                message = serialization.deserialize_message(payload, types.import_type(kind))
                setattr(expected, field, message)
                contents[field] = serialization.serialize_message(message)
        assembled = Assembler(types.fields_of, name.replace("/msg/", "/"), default).assemble(contents)
        _require_alike(assembled, expected, f"message {number}, a {name}")
        compared.add(name)
    return compared


def _require_alike(assembled: bytes, expected: Any, what: str) -> None:
    """Check each byte, but for padding, where rclpy leaves what was in memory: there alone may rclpy read no change."""
    serialized, message_type = serialization.serialize_message(expected), type(expected)
    assert len(serialized) >= len(assembled), what
    if serialized[: len(assembled)] != assembled:
        assert _is_same(serialization.deserialize_message(assembled, message_type), expected), what
    # rclpy leaves as many bytes behind a message as it estimated too many.
    # Of a sequence that is cut off it reads nothing, and does not fail.
    with suppress(RuntimeError):
        assert not _is_same(serialization.deserialize_message(assembled[:-1], message_type), expected), what


def _is_same(one: Any, other: Any) -> bool:
    """Whether two values are equal in each bit: NaN is, and zeros of other signs are not."""
    if isinstance(one, list):
        return len(one) == len(other) and all(map(_is_same, one, other))
    if hasattr(one, "get_fields_and_field_types"):
        return all(_is_same(getattr(one, name), getattr(other, name)) for name in one.get_fields_and_field_types())
    if isinstance(one, float):
        return struct.pack("d", one) == struct.pack("d", other)
    return one.tobytes() == other.tobytes() if isinstance(one, np.ndarray) or hasattr(one, "typecode") else one == other


def _members(message_type: Any) -> dict[str, str]:
    """The fields of a type that hold one message, and their types."""
    fields = message_type.get_fields_and_field_types()
    return {
        name: kind.replace("/", "/msg/") for name, kind in fields.items() if "/" in kind and not {"[", "<"} & {*kind}
    }
