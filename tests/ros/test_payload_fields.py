"""Fields read in place from the payloads of every installed type, against what was serialized."""

import random
import re
import sys

import pytest

from syncrelay.cdr_fields import TIME
from syncrelay.config import StampField
from syncrelay.config.interfaces import Interfaces
from syncrelay.errors import TypeImportError
from syncrelay.explain import Endpoint
from tests.recordings.datasets.drawn_messages import drawn_messages
from tests.ros.cdr_messages import STORE

pytest.importorskip("rclpy", reason="rclpy is not installed")
types = pytest.importorskip("syncrelay.relay.types")

import_type = types.import_type


def test_every_field_of_every_installed_type_reads_as_it_was_serialized():
    chance = random.Random(7)
    interfaces = Interfaces.find({})
    assert interfaces is not None
    names = {name for package in interfaces.packages for name in interfaces.types(package)} & STORE.fielddefs.keys()
    compared = 0
    for name in sorted(names):
        message_type = import_type(name)
        drawn = drawn_messages(STORE, name, chance, count=3)
        for path in _single_values(message_type):
            read = types.value_reader(message_type, path)
            for payload, value in zip(drawn.payloads, drawn.values, strict=True):
                # As text: a NaN is not equal to itself.
                assert repr(read(payload)) == repr(_value_at(value, path)), f"{name} {path}"
                compared += 1
    assert compared > 1000


def test_a_wstring_is_refused_by_name():
    with pytest.raises(TypeImportError, match="WStrings has no usable field wstring_value: wstring_value is wstring"):
        types.value_reader(import_type("test_msgs/msg/WStrings"), "wstring_value")


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
        message = message[step]
    if not isinstance(message, dict):
        return message
    # A time beyond its second is malformed.
    return message["sec"] * 10**9 + message["nanosec"] if message["nanosec"] < 10**9 else None


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
