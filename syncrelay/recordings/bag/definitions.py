"""Message types by their definitions: the recorded one, or that of ROS 2 Jazzy if none was recorded.

rosbags parses the definitions, and knows those of Jazzy's common packages; no ROS is needed.
"""

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any, Final, TypeAlias

from rosbags.convert.converter import is_same_wireformat
from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from syncrelay.cdr_walk import FieldsOf
from syncrelay.config.interfaces import ROSIDL
from syncrelay.errors import BagError
from syncrelay.recordings.bag.plain_definitions import WIDE_STRING, plain_idl, plain_msg
from syncrelay.recordings.bag.recording import Channel, Definition

Convert: TypeAlias = Callable[[bytes], bytes | None]
"""From a ROS 1 payload to the same message as CDR; None if it is malformed."""

_HEADER: Final = "std_msgs/msg/Header"
_TIME: Final = "builtin_interfaces/msg/Time"
# Far more than any real message has; rosbags takes seconds for it.
_MOST_FIELDS: Final = 20_000
_DEEPEST: Final = 50
# A gibibyte of doubles.
_LONGEST_ARRAY: Final = 1 << 27


def typestore(type_name: str, definition: Definition | None) -> Typestore | None:
    """Return what decodes CDR messages of a type; None if neither its definition nor ROS 2 knows it."""
    store = _store_of(type_name, definition)
    return store if type_name in store.fielddefs else None


def fields_of(channel: Channel) -> FieldsOf | None:
    """Return a function from a type (`pkg/Name`) within the channel's type to its fields, as in rosidl's classes.

    None if neither the recording nor ROS 2 knows the channel's type.
    """
    store = typestore(channel.type, channel.definition)
    return None if store is None else fields_in(store)


def fields_in(store: Typestore) -> FieldsOf:
    """Return a function from a type (`pkg/Name`) in a store to its fields, as in rosidl's classes."""

    def fields(name: str) -> Mapping[str, str]:
        package, _, message = name.partition("/")
        definition = store.fielddefs.get(f"{package}/msg/{message}", ([], []))
        return {field: _rosidl_type(description) for field, description in definition[1]}

    return fields


def require_same(channel: Channel, store: Typestore, *, of: str) -> None:
    """Raise BagError where a channel's messages are serialized by another definition than the one in a store."""
    recorded = typestore(channel.type, channel.definition)
    if recorded is None or channel.type not in store.fielddefs:
        raise BagError(f"{channel.topic}: the definition of {channel.type} is not known")
    if not is_same_wireformat(recorded, store, channel.type, channel.type):
        hashes = [hash_of(each, channel.type) for each in (recorded, store)]
        raise BagError(
            f"{channel.topic} is recorded with another definition of {channel.type} than {of} has here:"
            f" {hashes[0]}, here {hashes[1]}"
        )


def hash_of(store: Typestore, type_name: str) -> str:
    """Return the RIHS01 hash of a type in a store; an empty text if it has wide strings, which rosbags cannot hash."""
    try:
        return store.hash_rihs01(type_name)
    except KeyError:
        return ""


def begins_with_header(channel: Channel) -> bool | None:
    """Tell whether payloads begin with a std_msgs/Header; None if the type is unknown."""
    fields = _store_of(channel.type, channel.definition).fielddefs.get(channel.type)
    if fields is None:
        return None
    return bool(fields[1]) and fields[1][0][1] == (Nodetype.NAME, _HEADER)


def stamp_fields(type_name: str, definition: Definition | None = None) -> tuple[str, ...]:
    """Return where a type has times of its own and of its Headers, for `stamp: {field: ...}`; none if it is unknown."""
    _, fields = _store_of(type_name, definition).fielddefs.get(type_name, ([], []))
    paths = {_TIME: "{}", _HEADER: "{}.stamp"}
    return tuple(paths[what].format(name) for name, (kind, what) in fields if kind == Nodetype.NAME and what in paths)


def converter(channel: Channel) -> Convert:
    """Return what converts payloads of a ROS 1 channel to CDR; raises BagError if its definition cannot be read."""
    store = _store_of(channel.type, channel.definition)
    if channel.type not in store.fielddefs:
        raise BagError(f"{channel.topic}: the definition of {channel.type} in the bag cannot be read")

    def convert(payload: bytes) -> bytes | None:
        # No element is smaller than a byte: a larger count is wrong, and rosbags would loop over it for hours.
        store.max_sequence_length = max(1, len(payload))
        try:
            return bytes(store.ros1_to_cdr(payload, channel.type))
        except SerdeError:
            return None

    return convert


def as_ros2(channel: Channel) -> tuple[Definition | None, str]:
    """Return the definition and the RIHS01 hash that a ROS 2 recording of the channel has."""
    store = _store_of(channel.type, channel.definition)
    is_known = channel.type in store.fielddefs
    if channel.definition is not None and channel.definition.format != "ros1msg":
        return channel.definition, channel.type_hash or (hash_of(store, channel.type) if is_known else "")
    if not is_known:
        return None, channel.type_hash
    jazzy = _jazzy()
    if channel.type in jazzy.fielddefs and is_same_wireformat(store, jazzy, channel.type, channel.type):
        store = jazzy
    text, _ = store.generate_msgdef(channel.type, ros_version=2)
    return Definition("ros2msg", text), channel.type_hash or hash_of(store, channel.type)


def jazzy_definition(type_name: str) -> tuple[Definition, str]:
    """Return the definition and the hash of a type of ROS 2 Jazzy's common packages."""
    text, _ = _jazzy().generate_msgdef(type_name, ros_version=2)
    return Definition("ros2msg", text), _jazzy().hash_rihs01(type_name)


@lru_cache(maxsize=256)
def _store_of(type_name: str, definition: Definition | None) -> Typestore:
    """Return a store with a definition's type and all types within it; Jazzy's if the definition cannot be used."""
    if definition is None:
        return _jazzy()
    store = get_typestore(Stores.EMPTY)
    try:
        types = _parsed(type_name, definition)
        # ROS 1's Header begins with `seq`, which rosbags handles by itself.
        types.pop(_HEADER, None)
        types = {_HEADER: _jazzy().fielddefs[_HEADER], **types}
        types = {name: fields for name, fields in types.items() if name not in store.fielddefs}
        _require_bearable({**store.fielddefs, **types})
        store.register(types)
    except Exception:  # noqa: BLE001  the parser may raise anything: it asserts and recurses
        return _jazzy()
    return store


def _require_bearable(types: Mapping[str, Any]) -> None:
    """Raise ValueError or KeyError for types that contain themselves, unknown types, or too many fields."""
    weights: dict[str, int] = {}

    def weight_of(name: str, depth: int) -> int:
        if depth > _DEEPEST:
            raise ValueError(f"{name} contains itself")
        if name not in weights:
            weights[name] = sum(weight_of_field(description, depth) for _, description in types[name][1])
        if weights[name] > _MOST_FIELDS:
            raise ValueError(f"{name} has more fields than a message can")
        return weights[name]

    def weight_of_field(description: Any, depth: int) -> int:
        kind, what = description
        if kind == Nodetype.NAME:
            return weight_of(what, depth + 1)
        if kind == Nodetype.BASE:
            return 1
        element, count = what
        # rosidl refuses arrays of no elements. pyarrow divides by their number, which ends the process.
        if kind == Nodetype.ARRAY and not 0 < count <= _LONGEST_ARRAY:
            raise ValueError(f"an array of {count} elements is not one that a message can have")
        # Numbers side by side are skipped at once; everything else is visited one by one.
        is_plain = kind == Nodetype.SEQUENCE or (element[0] == Nodetype.BASE and "string" not in element[1][0])
        return weight_of_field(element, depth) * (1 if is_plain else count)

    for name in types:
        weight_of(name, 0)


def _parsed(type_name: str, definition: Definition) -> dict[str, Any]:
    if definition.format != "ros2idl":
        found = get_types_from_msg(plain_msg(definition.text), type_name)
        return {
            name: (constants, [(each, _widened(kind)) for each, kind in fields])
            for name, (constants, fields) in found.items()
        }
    types: dict[str, Any] = {}
    for text in plain_idl(definition.text):
        types |= get_types_from_idl(text)
    return types


def _widened(description: Any) -> Any:
    """Return the description of a field with wide strings in place of what stands for them."""
    kind, what = description
    if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        return kind, (_widened(what[0]), what[1])
    if kind == Nodetype.NAME and what.startswith(WIDE_STRING):
        return Nodetype.BASE, ("wstring", int(what.removeprefix(WIDE_STRING)))
    return description


@lru_cache(maxsize=1)
def _jazzy() -> Typestore:
    return get_typestore(Stores.ROS2_JAZZY)


def _rosidl_type(description: Any) -> str:
    kind, what = description
    if kind == Nodetype.BASE:
        name, bound = what
        return f"{ROSIDL.get(name, name)}<{bound}>" if bound else ROSIDL.get(name, name)
    if kind == Nodetype.NAME:
        return str(what).replace("/msg/", "/")
    element, count = what
    if kind == Nodetype.ARRAY:
        return f"{_rosidl_type(element)}[{count}]"
    return f"sequence<{_rosidl_type(element)}, {count}>" if count else f"sequence<{_rosidl_type(element)}>"
