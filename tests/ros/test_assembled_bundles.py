"""Messages of installed types put together from serialized ones, against what rclpy serializes."""

import random
from typing import Any

import pytest
from rosbags.serde import SerdeError

from syncrelay.cdr_assembly import Assembler
from syncrelay.config.interfaces import Interfaces
from tests.recordings.datasets.drawn_messages import drawn_message
from tests.ros.cdr_messages import STORE

serialization = pytest.importorskip("rclpy.serialization", reason="rclpy is not installed")
types = pytest.importorskip("syncrelay.relay.types")

_COUNT = 1000


def _zeroed(content: bytes, name: str) -> bytes:
    """The payload with zeros in its padding, where rclpy leaves what was in memory, and without what is behind it."""
    for end in range(len(content), 0, -1):
        try:
            return bytes(STORE.serialize_cdr(STORE.deserialize_cdr(content[:end], name), name))
        except SerdeError:
            pass
    raise AssertionError(f"this is no {name}: {content.hex()}")


def test_a_thousand_drawn_messages_of_all_installed_types_with_messages_in_them_are_as_rclpy_serializes_them():
    chance = random.Random(32)
    interfaces = Interfaces.find({})
    assert interfaces is not None
    names = {name for package in interfaces.packages for name in interfaces.types(package)} & STORE.fielddefs.keys()
    wholes = {name: members for name in sorted(names) if (members := _members(types.import_type(name)))}
    assert len(wholes) > 60
    compared: set[str] = set()
    for number in range(_COUNT):
        name = sorted(wholes)[number % len(wholes)]
        message_type = types.import_type(name)
        expected, contents = message_type(), {}
        default = _zeroed(serialization.serialize_message(expected), name)
        for field, kind in wholes[name].items():
            if chance.random() < 0.8:
                payload = bytes(STORE.serialize_cdr(drawn_message(STORE, kind, chance), kind))
                message = serialization.deserialize_message(payload, types.import_type(kind))
                setattr(expected, field, message)
                contents[field] = _zeroed(serialization.serialize_message(message), kind)
        assembled = Assembler(types.fields_of, name.replace("/msg/", "/"), default).assemble(contents)
        assert assembled == _zeroed(serialization.serialize_message(expected), name), f"{name}, seed 32"
        compared.add(name)
    assert compared == wholes.keys()


def _members(message_type: Any) -> dict[str, str]:
    """The fields of a type that hold one message, and their types."""
    fields = message_type.get_fields_and_field_types()
    return {
        name: kind.replace("/", "/msg/") for name, kind in fields.items() if "/" in kind and not {"[", "<"} & {*kind}
    }
