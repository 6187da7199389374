"""A definition that no message can have costs no time and no traceback: its type counts as unknown."""

import random
import struct
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from syncrelay.cdr import LATEST_STAMP
from syncrelay.config import StampField
from syncrelay.errors import BagError
from syncrelay.recordings.bag.definitions import as_ros2, begins_with_header, converter, fields_of, stamp_fields
from syncrelay.recordings.bag.payloads import read_ros1_stamp, stamp_reader, value_reader
from syncrelay.recordings.bag.recording import Channel, Definition, Encoding
from tests.faults.extent import chosen
from tests.recordings.bag.making import CUSTOM, CUSTOM_TEXT

_TYPE = "rig_msgs/msg/Blip"
_RULE = "\n" + "=" * 80 + "\n"
_HEADER = "std_msgs/Header header\n"


def _channel(text: str, *, encoding: Encoding = Encoding.CDR, form: str = "ros2msg", type_name: str = _TYPE) -> Channel:
    return Channel(1, "/blip", type_name, encoding, Definition(form, text))


def _nested(levels: int, fields: int) -> str:
    parts = [f"MSG: rig_msgs/T{n}\n" + "".join(f"T{n + 1} f{m}\n" for m in range(fields)) for n in range(levels)]
    return _RULE.join([f"{_HEADER}T0 t\nuint32 n\n", *parts, f"MSG: rig_msgs/T{levels}\nuint8 x\n"])


_USELESS = {
    "a type that holds itself": f"{_HEADER}Blip blip\nuint32 n\n",
    "two that hold each other": f"{_HEADER}A a\n{_RULE}MSG: rig_msgs/A\nBlip[] blips\n",
    "one that is not there": f"{_HEADER}rig_msgs/Other other\nuint32 n\n",
    "ten to the twentieth fields": _nested(20, 10),
    "types in types in types": _nested(500, 1),
    "a billion of another": f"{_HEADER}B[1000000000] b\nuint32 n\n{_RULE}MSG: rig_msgs/B\nuint8 x\n",
    "a billion texts": f"{_HEADER}string[1000000000] texts\nuint32 n\n",
    "a million wide texts": f"{_HEADER}wstring[1000000] texts\nuint32 n\n",
    "arrays of nothing": f"{_HEADER}uint8[0] x\nuint32 n\n",
    "a constant without an end": f"{_HEADER}float64 X=1e999\nuint32 n\n",
    "no definition": "\0\x1b[31m",
    "more than any text": "uint8 x\n" * 200_000,
    "more lines than any message has": f"{_HEADER}uint32 n\n" + "uint8 A=1\n" * 9_000,
    "lines of nothing": "\n" * 900_000 + "?",
    "comments": "# hm\n" * 190_000 + "?",
}


@pytest.mark.parametrize("text", _USELESS.values(), ids=_USELESS)
@pytest.mark.parametrize(("encoding", "form"), [(Encoding.CDR, "ros2msg"), (Encoding.ROS1, "ros1msg")])
def test_a_definition_of_no_use_leaves_the_type_unknown(text, encoding, form):
    channel = _channel(text, encoding=encoding, form=form)
    assert (fields_of(channel), begins_with_header(channel)) == (None, None)
    assert as_ros2(channel)[1] == ""
    with pytest.raises(BagError, match="does not define"):
        value_reader(channel, "n")
    with pytest.raises(BagError, match="cannot be read"):
        converter(channel)


_LONGEST = 2**27


def test_no_number_in_a_definition_is_too_large_for_a_reader():
    """Drawn: arrays, bounded ones and bounded texts, of any count, before and behind a time and a number."""
    chance = random.Random(28)
    for number in range(chosen(short=150, long=5000)):
        lengths, lines = [], []
        for place in range(chance.randint(1, 4)):
            count = max(0, int(2 ** chance.uniform(0, chance.choice((30, 70, 900)))) + chance.randint(-1, 1))
            primitive = chance.choice(("uint8", "char", "bool", "int16", "float32", "float64", "uint64"))
            form = chance.choice(("{0}[{1}]", "{0}[{1}]", "{0}[<={1}]", "string<={1}", "string<={1}[]", "{0}[]"))
            lengths += [count] if form == "{0}[{1}]" else []
            lines.append(f"{form.format(primitive, count)} field_{place}")
        lines.insert(chance.randint(0, len(lines)), "builtin_interfaces/Time seen")
        channel = _channel("\n".join([*lines, "uint32 n"]))
        payload = b"\0\1\0\0" + chance.randbytes(chance.randint(0, 200))
        told = f"definition {number} of seed 28: {lines}"
        try:
            read = [value_reader(channel, "n"), stamp_reader(StampField(field="seen"), channel)]
            found = [None if each is None else each(payload) for each in read]
        except BagError:
            assert 0 in lengths or max(lengths) > _LONGEST, told
            continue
        except Exception as error:
            error.add_note(told)
            raise
        assert all(0 < each <= _LONGEST for each in lengths), told
        assert all(each is None or isinstance(each, int) for each in found), told
        assert max(lengths, default=0) < len(payload) or None in found, told


_TIME, _LEADING = ("builtin_interfaces/Time", "{0}"), ("std_msgs/Header", "{0}")
# Types and forms as .msg files have them, each with rosidl's name, and with that of IDL where it is another.
_TYPES = {
    "uint8": ("uint8", "uint8"),
    "char": ("uint8", "uint8"),
    "byte": ("octet", "octet"),
    "bool": ("boolean", "boolean"),
    "float64": ("double", "double"),
    "string": ("string", "string"),
    "string<=7": ("string<7>", "string<7>"),
    "wstring": ("wstring", "wstring"),
    "wstring<=7": ("wstring<7>", "wstring<7>"),
    _TIME[0]: (_TIME[0], "builtin_interfaces::msg::Time"),
    _LEADING[0]: (_LEADING[0], "std_msgs::msg::Header"),
}
_FORMS = {
    "{0}": ("{0}", "{0} {1};"),
    "{0}[]": ("sequence<{0}>", "sequence<{0}> {1};"),
    "{0}[3]": ("{0}[3]", "{0} {1}[3];"),
    "{0}[<=4]": ("sequence<{0}, 4>", "sequence<{0}, 4> {1};"),
}


# Constants as .msg files have them.
_CONSTANTS = ["", "string EMPTY=\n", 'wstring WIDE="wide"\nuint8 ONE=1\n']


@given(
    st.lists(st.tuples(st.sampled_from([*_TYPES]), st.sampled_from([*_FORMS])), min_size=1, max_size=6),
    st.sampled_from(_CONSTANTS),
    st.sampled_from(["\n", "\r\n"]),
)
def test_of_a_definition_in_any_format_the_same_is_known(fields, constants, line_end):
    named = [(f"f{number}", *each) for number, each in enumerate(fields)]
    plain = "".join(f"{form.format(kind)} {name}\n" for name, kind, form in named)
    idl = _idl("".join(_FORMS[form][1].format(_TYPES[kind][1], name) for name, kind, form in named))
    # rosbags knows wide strings in IDL alone, and has no hash of them; ROS 1 has none.
    is_wide = "wstring" in plain
    theirs = get_typestore(Stores.ROS2_JAZZY)
    if not is_wide:
        theirs.register(get_types_from_msg(plain.replace("char ", "uint8 ").replace("char[", "uint8["), _TYPE))
    msg = constants + plain + _RULE + "MSG: rig_msgs/Unused\nuint8 x\n"
    for form, text in (("ros2msg", msg), ("ros2idl", idl), *([] if is_wide else [("ros1msg", msg)])):
        channel = _channel(text.replace("\n", line_end), form=form)
        found = fields_of(channel)
        assert found is not None
        assert found("rig_msgs/Blip") == {name: _FORMS[form][0].format(_TYPES[kind][0]) for name, kind, form in named}
        assert found("rig_msgs/Other") == {}
        assert begins_with_header(channel) == (fields[0] == _LEADING)
        paths = {_TIME: "{}", _LEADING: "{}.stamp"}
        times = tuple(paths[kind, shape].format(name) for name, kind, shape in named if (kind, shape) in paths)
        assert stamp_fields(_TYPE, channel.definition) == times
        definition, hashed = as_ros2(channel)
        assert definition is not None
        assert definition.format == (form if form != "ros1msg" else "ros2msg")
        assert form == "ros1msg" or definition == channel.definition
        again = fields_of(replace(channel, definition=definition))
        assert again is not None
        assert again("rig_msgs/Blip") == found("rig_msgs/Blip")
        assert hashed == ("" if is_wide else theirs.hash_rihs01(_TYPE)) or "char" in msg
        assert as_ros2(replace(channel, type_hash="as recorded"))[1] == "as recorded"


def _idl(fields: str, constants: str = "") -> str:
    return f"module rig_msgs {{ module msg {{ {constants} struct Blip {{ {fields} }}; }}; }};"


_USELESS_IDL = {
    "modules in modules": "module a { " * 5000,
    "sequences of sequences": _idl("sequence<" * 24 + " x;"),
    "many sequences of sequences": _idl("sequence<" * 5000 + " x;"),
    "a constant in brackets": _idl("uint8 x;", "const uint8 A = (((1)));"),
    "an annotation in brackets": _idl("@x(v=(((1)))) uint8 x;"),
    "a constant of gigabytes": _idl("uint8 x;", "const uint64 A = 1 << 99999999999;"),
    "more constants than any": _idl("uint8 x;", "const uint8 A = 1;" * 5000),
    "a constant of many texts": _idl("uint8 x;", "const string A = " + '"b" ' * 24_000 + ";"),
    "values of sums": _idl("uint8 x;", "enum E { " + f"@value(1{'|1' * 100}) A, " * 200 + "B };"),
    "annotations of nothing": "@x " * 300_000,
    "annotations without an end": '@x("a" ' * 140_000,
    "texts without an end": '"\\' * 300_000,
    "comments without an end": "/*a" * 300_000,
    "no definition": "\xff",
}


def test_annotations_comments_and_includes_of_idl_do_not_matter():
    verbatim = '@verbatim (language="comment", text=\n  "Of (all) \\"blips\\"" "\\n" // hm\n)'
    enum = "enum Kind { @value(1) ONE, @value (2) TWO };"
    members = "".join(f"{verbatim} @unit(value='m') uint8 x{n}; /* ( */ // (\n" for n in range(1000))
    include = '#include "rig_msgs/msg/Header.idl"\n\n'
    for begin in ("", include):
        fields = fields_of(_channel(begin + _idl(members, enum), form="ros2idl"))
        assert fields is not None
        assert fields("rig_msgs/Blip") == {f"x{n}": "uint8" for n in range(1000)}


@pytest.mark.timeout(120)
@pytest.mark.parametrize("text", _USELESS_IDL.values(), ids=_USELESS_IDL)
def test_an_idl_that_nests_without_end_leaves_the_type_unknown(text):
    assert begins_with_header(_channel(text, form="ros2idl")) is None


def test_of_a_type_that_does_not_begin_with_its_header_the_field_to_write_is_named():
    with pytest.raises(
        BagError, match=r": write `stamp: \{field: header\.stamp\}`, or `stamp: receive` to go by arrival$"
    ):
        stamp_reader("header", _channel("uint8 number\nstd_msgs/Header header\n"))


@pytest.mark.parametrize("field", ["number", "label", "header"])
def test_a_stamp_is_read_from_a_time_and_from_nothing_else(field):
    channel = _channel(CUSTOM_TEXT, type_name=CUSTOM)
    assert stamp_reader(StampField(field="seen"), channel) is not None
    with pytest.raises(BagError, match=f"no field {field} to go by: .*expected builtin_interfaces/Time"):
        stamp_reader(StampField(field=field), channel)


def test_a_ros1_stamp_that_ros2_cannot_tell_is_none():
    last = LATEST_STAMP // 10**9
    assert read_ros1_stamp(struct.pack("<III", 1, last, 999_999_999)) == LATEST_STAMP
    assert read_ros1_stamp(struct.pack("<III", 1, last + 1, 0)) is None
