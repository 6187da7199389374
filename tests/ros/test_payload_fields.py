"""Fields read in place from the payloads of every installed type, against what rclpy makes of them."""

import random
import re
import sys

import pytest

from syncrelay.cdr_fields import TIME
from syncrelay.config import StampField
from syncrelay.config.interfaces import Interfaces
from syncrelay.errors import TypeImportError
from syncrelay.explain import Endpoint

serialization = pytest.importorskip("rclpy.serialization", reason="rclpy is not installed")
types = pytest.importorskip("syncrelay.relay.types")

import_type = types.import_type


def test_every_field_of_every_installed_type_reads_as_rclpy_deserializes_it():
    chance = random.Random(7)
    interfaces = Interfaces.find({})
    assert interfaces is not None
    names = {name for package in interfaces.packages for name in interfaces.types(package) if "/msg/" in name}
    compared = 0
    # Nothing of a wstring is read: its layout differs between versions of Fast CDR.
    for name in sorted(names - {"test_msgs/msg/WStrings"}):
        message_type = import_type(name)
        for _ in range(3):
            payload = serialization.serialize_message(_filled(message_type, chance))
            message = serialization.deserialize_message(payload, message_type)
            for path in _single_values(message_type):
                value = types.value_reader(message_type, path)(payload)
                assert value == _value_at(message, path), f"{name} {path}"
                compared += 1
    assert compared > 1000


def test_a_wstring_is_refused_by_name():
    with pytest.raises(TypeImportError, match="WStrings has no usable field wstring_value: wstring_value is wstring"):
        types.value_reader(import_type("test_msgs/msg/WStrings"), "wstring_value")


_BITS = {
    "int8": 7,
    "uint8": 8,
    "char": 8,
    "int16": 15,
    "uint16": 16,
    "int32": 31,
    "uint32": 32,
    "int64": 63,
    "uint64": 64,
}


def _filled(message_type, chance):
    def value(kind):
        if array := re.fullmatch(r"(.+)\[(\d+)\]", kind):
            return [value(array[1]) for _ in range(int(array[2]))]
        if sequence := re.fullmatch(r"sequence<(.+?)(?:, (\d+))?>", kind):
            return [value(sequence[1]) for _ in range(chance.randint(0, min(3, int(sequence[2] or 3))))]
        if "/" in kind:
            return _filled(import_type(kind.replace("/", "/msg/")), chance)
        return _primitive(kind, chance)

    message = message_type()
    for name, kind in message_type.get_fields_and_field_types().items():
        # A time beyond its second is malformed, which other tests look at.
        setattr(message, name, chance.randrange(10**9) if name == "nanosec" else value(kind))
    return message


def _primitive(kind, chance):
    if kind in _BITS:
        return chance.randrange(2 ** _BITS[kind])
    others = {
        "boolean": chance.random() < 0.5,
        "octet": bytes([chance.randrange(256)]),
        "float": float(chance.randrange(-99, 99)),
        "double": float(chance.randrange(-99, 99)),
    }
    return others.get(kind, "".join(chance.choice("abcdé") for _ in range(chance.randrange(7))))


def _single_values(message_type):
    for name, kind in message_type.get_fields_and_field_types().items():
        if "[" in kind or "<" in kind.removeprefix("string"):
            continue
        if "/" not in kind or kind == TIME:
            yield name
        else:
            below = import_type(kind.replace("/", "/msg/"))
            yield from (f"{name}.{path}" for path in _single_values(below))


def _value_at(message, path):
    for step in path.split("."):
        message = getattr(message, step)
    if type(message).__name__ == "Time":
        return message.sec * 10**9 + message.nanosec
    return message[0] if isinstance(message, bytes) else message


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("antigravity/msg/Joke", "the package antigravity has no msg"),
        ("no_such_msgs/msg/Thing", "No module named 'no_such_msgs'"),
        ("std_msgs/msg/Nothing", "Nothing"),
        ("Chatter", "`Chatter` is not a message type"),
        ("a/b/c/d", "`a/b/c/d` is not a message type"),
    ],
)
def test_a_type_that_the_graph_names_and_nobody_has_is_an_error_and_imports_nothing(name, why):
    with pytest.raises(TypeImportError, match=re.escape(why)):
        import_type(name)
    assert "antigravity" not in sys.modules


@pytest.mark.parametrize("path", ["header.frame_id", "height"])
def test_a_stamp_is_a_time_also_where_the_file_left_the_type_to_the_graph(path):
    image = import_type("sensor_msgs/msg/Image")
    with pytest.raises(TypeImportError, match=rf"no usable field {re.escape(path)}: {re.escape(path)} is .*Time"):
        types.stamp_reader(StampField(field=path), image)
    assert types.stamp_reader(StampField(field="header.stamp"), image) is not None


def test_types_settle_when_all_publishers_agree_for_a_while():
    image, other, unnamed = Endpoint("/a", "I"), Endpoint("/b", "J"), Endpoint("?", "I", is_named=False)
    settling = types.SettlingType()
    assert settling.publisher([], now=0.0) is None
    assert settling.publisher([unnamed], now=1.0) is None
    assert settling.publisher([unnamed, image], now=1.4) is None
    assert settling.publisher([unnamed, image], now=1.5) == image
    assert settling.publisher([unnamed, image, other], now=1.6) is None
    assert settling.publisher([other], now=1.7) is None
    assert settling.publisher([unnamed], now=2.3) is None
    assert settling.publisher([unnamed], now=2.8) == unnamed
