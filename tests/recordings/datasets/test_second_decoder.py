"""Cells of a dataset equal what was serialized and what another decoder reads, for every installed message type."""

import math
import random
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.interfaces import Nodetype
from rosbags.typesys import get_types_from_msg
from rosbags.typesys.store import Typestore

from syncrelay.recordings.bag.definitions import typestore
from syncrelay.recordings.bag.recording import Definition
from syncrelay.recordings.datasets.decoding import Decoder
from syncrelay.recordings.datasets.message_types import type_tree
from tests.faults.extent import chosen

mcap_ros2 = pytest.importorskip("mcap_ros2._dynamic")

_FILES = {
    f"{path.parts[-3]}/msg/{path.stem}": path.read_text() for path in Path(sys.prefix, "share").glob("*/msg/*.msg")
}
_PACKAGES = sorted({name.split("/")[0] for name in _FILES})
_MEMBER = re.compile(r"^\s*([\w/]+?)(?:<=\d+)?(?:\[[^\]]*\])?\s+\w+", re.MULTILINE)
# Rows that are alike are decoded as columns, others one by one; those from 64 kB on without a copy.
_SIZES = ("alike", "unlike", "large")
_LARGE = 70_000
_DRAWN = chosen(short=1, long=20)


@pytest.mark.faults
@pytest.mark.parametrize("package", _PACKAGES)
def test_every_cell_is_what_was_serialized_and_what_a_second_decoder_reads(package):
    for name in (each for each in _FILES if each.startswith(f"{package}/")):
        text = _with_members(name)
        store = typestore(name, Definition(format="ros2msg", text=text))
        if re.search(r"^\s*wstring\b", text, re.MULTILINE):
            # rosbags knows no wstring: such a type has no decoder, and is not decoded wrongly.
            assert store is None, name
            continue
        assert store is not None, name
        read = mcap_ros2.generate_dynamic(name, text)[name]
        for sizes in _SIZES:
            for is_little in (True, False):
                drawn = [each for seed in range(_DRAWN) for each in _messages(store, name, f"{name} {seed}", sizes)]
                payloads = [bytes(store.serialize_cdr(each, name, little_endian=is_little)) for each in drawn]
                rows = Decoder(store, type_tree(store, name)).decode(payloads).to_pylist()
                assert len(rows) == len(payloads)
                for row, message, payload in zip(rows, drawn, payloads, strict=True):
                    where = (name, sizes, is_little)
                    assert _differences(store, name, row, message) == [], where
                    assert _differences(store, name, row, read(payload)) == [], where


def _with_members(name: str) -> str:
    """Return the definition of a type with those of its members behind it, as recordings have it."""
    seen = [name]
    for each in seen:
        for member in _MEMBER.findall(re.sub(r"#.*", "", _FILES[each])):
            package, _, message = member.replace("/msg/", "/").rpartition("/")
            found = f"{package or each.split('/')[0]}/msg/{message}"
            if found in _FILES and found not in seen:
                seen.append(found)
    rest = [f"{'=' * 80}\nMSG: {each.replace('/msg/', '/')}\n{_FILES[each]}\n" for each in seen[1:]]
    return "\n".join([_FILES[name], *rest])


def _messages(store: Typestore, name: str, seed: str, sizes: str) -> list[Any]:
    """Draw five messages whose lengths are the same or differ, and a large one beside them where that is asked for."""
    lengths = random.Random(seed)
    same = lengths.randrange(1_000_000)
    found = [
        _draw(store, name, random.Random(f"{seed} {n}"), random.Random(same if sizes == "alike" else same + n), 0)
        for n in range(5)
    ]
    if sizes == "large":
        found.append(_draw(store, name, random.Random(f"{seed} l"), random.Random(same), _LARGE))
    return found


def _draw(store: Typestore, name: str, values: random.Random, lengths: random.Random, longest: int) -> Any:
    fields = store.fielddefs[name][1]
    return store.types[name](*(_field(store, kind, values, lengths, longest) for _, kind in fields))


def _field(store: Typestore, kind: Any, values: random.Random, lengths: random.Random, longest: int) -> Any:
    what, of = kind
    if what == Nodetype.NAME:
        return _draw(store, of, values, lengths, 0 if longest < _LARGE else longest)
    if what == Nodetype.BASE:
        return _single(of, values, lengths)
    element, bound = of
    count = bound if what == Nodetype.ARRAY else lengths.randrange(min(bound or 4, 4) + 1)
    is_numbers = element[0] == Nodetype.BASE and element[1][0] != "string"
    if what == Nodetype.SEQUENCE and is_numbers and longest and not bound:
        count = longest
    if is_numbers:
        kinds = {"byte": "int8", "octet": "int8", "char": "uint8"}
        # A long run is of a few values: to draw each takes longer than all the rest.
        few = [_single(element[1], values, lengths) for _ in range(min(count, 16))]
        return np.array([few[n % 16] for n in range(count)], dtype=kinds.get(element[1][0], element[1][0]))
    return [_field(store, element, values, lengths, 0) for _ in range(count)]


def _single(kind: tuple[str, int], values: random.Random, lengths: random.Random) -> Any:
    name, bound = kind
    match name:
        case "string":
            # Characters of one, two and three bytes: an alike message keeps the count of each.
            return "".join(values.choice("aZ_/9") for _ in range(lengths.randrange(min(bound or 6, 6) + 1)))
        case "bool":
            return values.random() < 0.5
        case "float32" | "float64":
            found = values.choice((0.0, -0.0, math.inf, -math.inf, math.nan, values.gauss(0, 1e6), values.random()))
            return float(np.float32(found)) if name == "float32" else found
        case "byte" | "octet":
            return values.choice((-128, -1, 0, 127, values.randrange(-128, 128)))
    bits = int("8" if name == "char" else re.sub(r"\D", "", name))
    low = -(2 ** (bits - 1)) if name.startswith("int") else 0
    return values.choice((low, low + 2**bits - 1, 0, values.randrange(low, low + 2**bits)))


def _differences(store: Typestore, name: str, row: Any, message: Any, path: str = "") -> list[str]:
    """Return the paths of the fields whose cell is not what the message holds."""
    if row is None:
        return [f"{path or name} is null"]
    found = []
    fields: Any = store.fielddefs[name][1]
    for field, (what, of) in fields:
        if field == "structure_needs_at_least_one_member":
            continue  # Padding, which the second decoder leaves out.
        value = getattr(message, field)
        if field not in row:
            # A message without fields has no column.
            found += [] if what == Nodetype.NAME and not store.fielddefs[of][1] else [f"{path}.{field} is missing"]
        elif what == Nodetype.NAME:
            found += _differences(store, of, row[field], value, f"{path}.{field}")
        elif what != Nodetype.BASE and of[0][0] == Nodetype.NAME:
            inner = zip(row[field], value, strict=True)
            found += [
                each for cell, one in inner for each in _differences(store, of[0][1], cell, one, f"{path}.{field}")
            ]
        elif not _equal(row[field], value):
            found.append(f"{path}.{field}: {row[field]!r} instead of {value!r}"[:300])
    return found


def _equal(cell: Any, value: Any) -> bool:
    if isinstance(cell, (str, bool)):
        return bool(cell == value)
    if isinstance(cell, (int, float)):
        # A `byte` is signed to rosbags, and bytes to mcap_ros2.
        plain = value[0] if isinstance(value, bytes) else value
        return _equal_numbers([cell], [plain])
    if cell and isinstance(cell[0], str):
        return list(cell) == list(value)
    return _equal_numbers(list(cell), list(value))


def _equal_numbers(cells: list[Any], values: list[Any]) -> bool:
    plain = [each[0] if isinstance(each, bytes) else getattr(each, "item", lambda each=each: each)() for each in values]
    if len(cells) != len(plain):
        return False
    return all(
        one == other or (one != one and other != other) or (one - other == 256 and other < 0)  # noqa: PLR0124
        for one, other in zip(cells, plain, strict=True)
    )


def test_types_with_constants_are_among_them():
    assert "sensor_msgs/msg/PointField" in _FILES
    assert get_types_from_msg(_FILES["sensor_msgs/msg/PointField"], "sensor_msgs/msg/PointField")
