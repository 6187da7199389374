"""One field of a payload, read in place, by bytes written out by hand."""

import random
import re
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.cdr_fields import TIME, field_reader
from syncrelay.cdr_walk import MOST_VALUES, UnreadableFieldError
from tests.calls import Calls
from tests.faults.extent import chosen

_TYPES = {
    "a/Track": {
        "header": "std_msgs/Header",
        "quality": "uint8",
        "weights": "sequence<double>",
        "id": "uint32",
        "boxes": "sequence<a/Box>",
        "seen": TIME,
        "name": "string<8>",
        "corners": "double[2]",
        "last": "int64",
    },
    "a/Box": {"label": "string", "edge": "uint16"},
    "std_msgs/Header": {"stamp": TIME, "frame_id": "string"},
    TIME: {"sec": "int32", "nanosec": "uint32"},
}

_LITTLE_ENDIAN = bytes.fromhex(
    "00 01 00 00"  # encapsulation: CDR_LE
    "05 00 00 00  07 00 00 00"  # header.stamp: 5 s, 7 ns
    "04 00 00 00  63 61 6d 00"  # header.frame_id: `cam` and its zero
    "09"  # quality
    "00 00 00"  # up to the length of weights
    "01 00 00 00"  # one weight, the double at 24
    "00 00 00 00 00 00 f0 3f"  # 1.0
    "2a 00 00 00"  # id
    "02 00 00 00"  # two boxes
    "02 00 00 00  78 00"  # `x`
    "03 00"  # edge
    "01 00 00 00  00"  # an empty label
    "00"  # up to the uint16
    "04 00"  # edge
    "06 00 00 00  08 00 00 00"  # seen: 6 s, 8 ns
    "03 00 00 00  68 69 00"  # name: `hi`
    "00"  # up to the doubles, at 72
    "00 00 00 00 00 00 00 00  00 00 00 00 00 00 00 00"  # corners
    "fe ff ff ff ff ff ff ff"  # last: -2
)
_ALL = {
    "header.stamp": 5_000_000_007,
    "header.frame_id": "cam",
    "quality": 9,
    "id": 42,
    "seen": 6_000_000_008,
    "name": "hi",
    "last": -2,
}


def _read(path, payload):
    return field_reader(_TYPES.__getitem__, "a/Track", path)(payload)


@pytest.mark.parametrize(("path", "value"), _ALL.items())
def test_a_field_is_found_behind_all_that_stands_before_it(path, value):
    assert _read(path, _LITTLE_ENDIAN) == value


def test_big_endian_and_the_narrower_alignment_of_xcdr2_are_heeded():
    fields = {"a/Odd": {"first": "uint8", "second": "double", "third": "uint16"}}
    values = (1, 2.5, 3)
    wide = {0x00: struct.Struct(">B7xdH"), 0x01: struct.Struct("<B7xdH")}
    narrow = {0x06: struct.Struct(">B3xdH"), 0x07: struct.Struct("<B3xdH")}
    for kind, layout in {**wide, **narrow}.items():
        payload = bytes([0, kind, 0, 0]) + layout.pack(*values)
        read = [field_reader(fields.__getitem__, "a/Odd", name)(payload) for name in fields["a/Odd"]]
        assert read == [1, 2.5, 3], hex(kind)


def test_a_member_without_fields_takes_one_byte():
    types: dict[str, dict[str, str]] = {"a/Signal": {"go": "std_msgs/Empty", "level": "uint8"}, "std_msgs/Empty": {}}
    assert field_reader(types.__getitem__, "a/Signal", "level")(bytes.fromhex("00 01 00 00  00 07")) == 7


@pytest.mark.parametrize("path", _ALL)
def test_a_payload_cut_off_before_its_field_ends_gives_none(path):
    whole = [_read(path, _LITTLE_ENDIAN[:end]) for end in range(len(_LITTLE_ENDIAN) + 1)]
    first = whole.index(_ALL[path])
    assert set(whole[:first]) == {None}
    assert set(whole[first:]) == {_ALL[path]}


_GOOD_HEADERS = st.sampled_from([bytes([0, kind, 0, 0]) for kind in (0, 1, 6, 7)])


@given(_GOOD_HEADERS | st.just(b""), st.binary(max_size=120), st.sampled_from(sorted(_ALL)))
def test_any_bytes_give_a_value_or_none_behind_a_good_header_too(header, body, path):
    value = _read(path, header + body)
    assert value is None or isinstance(value, type(_ALL[path]))


def test_a_length_that_the_payload_cannot_hold_is_not_counted_down():
    four_billion = _LITTLE_ENDIAN.replace(b"\x02\0\0\0\x02\0\0\0x\0", b"\xff\xff\xff\xff\x02\0\0\0x\0")
    assert four_billion != _LITTLE_ENDIAN
    assert _read("seen", four_billion) is None


def test_no_message_is_gone_through_for_long():
    """Drawn: lists of texts, numbers and messages, in one another, before a number; as many as are gone through."""
    chance = random.Random(28)
    counts: list[int] = []
    for number in range(chosen(short=20, long=1000)):
        types, payload, values = _drawn(chance)
        with Calls() as calls:
            found = field_reader(types.__getitem__, "a/Whole", "last")(payload)
        told = f"message {number} of seed 28: {types}, {len(payload)} bytes, {values} values"
        assert found == (7 if values <= MOST_VALUES else None), told
        # A few for each value; numbers beside each other are passed at once, however many they are.
        assert calls.count < 10 * min(values, MOST_VALUES) + 100, told
        counts.append(values)
    assert min(counts) <= MOST_VALUES < max(counts)


def _drawn(chance: random.Random) -> tuple[dict[str, dict[str, str]], bytes, int]:
    """A type, a message of it with 7 as its last field, and how many values before that are gone through one by one."""
    kinds = ["string", "uint8", "uint32", "sequence<uint8>"]
    types = {"a/Element": {f"f{n}": chance.choice(kinds) for n in range(chance.randint(1, 5))}}
    types["a/Middle"] = {"elements": "sequence<a/Element>", "label": "string"}
    types["a/Whole"] = {"first": chance.choice(("sequence<a/Middle>", "sequence<a/Element>", "sequence<string>"))}
    types["a/Whole"]["last"] = "uint32"
    passed = 0
    are_equal = all(each in ("uint8", "uint32") for each in types["a/Element"].values())

    def written(name: str, content: bytearray, most: int) -> None:
        nonlocal passed
        if name in types:
            passed += len(types[name])
            for each in types[name].values():
                written(each, content, most)
        elif name == "uint8":
            content.append(3)
        elif name.startswith("sequence<a/") or name == "sequence<string>":
            count = int(most ** chance.uniform(0.3, 1))
            _put(content, count)
            element = name[len("sequence<") : -1]
            # Elements of one size are passed at once, from the second on.
            walked = min(count, 2) if element == "a/Element" and are_equal else count
            passed += walked
            for number in range(count):
                before = passed
                written(element, content, 8)
                passed = passed if number < walked else before
        elif name == "uint32":
            _put(content, 4)
        else:
            size = chance.randint(1, 5)
            _put(content, size)
            content += bytes(size)

    content = bytearray()
    written(types["a/Whole"]["first"], content, 30_000)
    _put(content, 7)
    return types, b"\0\1\0\0" + content, passed


def _put(content: bytearray, number: int) -> None:
    content += bytes(-len(content) % 4) + struct.pack("<I", number)


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("header.stamps", "std_msgs/Header has no field stamps, it has stamp, frame_id"),
        ("weights", "weights is sequence<double>, expected a number, a string or a time"),
        ("boxes.label", "sequence<a/Box> has no field label"),
        ("id.value", "uint32 has no field value"),
    ],
)
def test_a_path_that_leads_to_no_single_value_is_refused_in_words(path, words):
    with pytest.raises(UnreadableFieldError, match=re.escape(words)):
        field_reader(_TYPES.__getitem__, "a/Track", path)
