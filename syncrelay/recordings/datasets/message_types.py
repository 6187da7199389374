"""Message types as trees, their types in Arrow, and which of their fields are asked for.

A message within a message is a struct, `T[n]` a fixed-size list and `T[]` a list in Arrow. `uint8[]` and `byte[]` are
binary, so that images, clouds and packets stay bytes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, TypeAlias

import pyarrow as pa
from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

from syncrelay.config.wording import did_you_mean
from syncrelay.errors import BagError
from syncrelay.recordings.datasets.units import unit_of

Sizes: TypeAlias = tuple[int, ...] | None
"""How many bytes a value takes with the padding before it: for a value that begins 0, 1, ... 7 bytes behind a multiple
of 8 bytes. None where the size depends on the message: of strings and sequences, and what they are in.
"""

_LARGEST_ALIGNMENT: Final = 8


@dataclass(frozen=True, slots=True)
class Number:
    """A number or a bool: numpy's code without a byte order, Arrow's type, and how many bytes it has."""

    code: str
    arrow: pa.DataType
    size: int
    sizes: Sizes = field(init=False)

    def __post_init__(self) -> None:
        sizes = tuple([-place % self.size + self.size for place in range(_LARGEST_ALIGNMENT)])
        object.__setattr__(self, "sizes", sizes)


@dataclass(frozen=True, slots=True)
class Text:
    """A string."""

    sizes: Sizes = field(init=False, default=None)


@dataclass(frozen=True, slots=True)
class Field:
    """A field of a message. One that is not asked for is skipped, and is not in the result."""

    name: str
    node: "Node"
    is_wanted: bool = True


@dataclass(frozen=True, slots=True)
class Struct:
    """A message of a type (`pkg/msg/Name`)."""

    type: str
    fields: tuple[Field, ...]
    sizes: Sizes = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "sizes", _size_of_all([each.node.sizes for each in self.fields]))


@dataclass(frozen=True, slots=True)
class Array:
    """A fixed number of elements."""

    element: "Node"
    count: int
    sizes: Sizes = field(init=False)

    def __post_init__(self) -> None:
        each = self.element.sizes
        places = range(_LARGEST_ALIGNMENT)
        sizes = None if each is None else tuple([size_of_many(each, self.count, place) for place in places])
        object.__setattr__(self, "sizes", sizes)


@dataclass(frozen=True, slots=True)
class Run:
    """As many elements as the message says."""

    element: "Node"
    sizes: Sizes = field(init=False, default=None)

    @property
    def is_bytes(self) -> bool:
        """Whether Arrow has it as binary."""
        return isinstance(self.element, Number) and self.element.arrow == pa.uint8()


Node: TypeAlias = Number | Text | Struct | Array | Run

_NUMBERS: Final = {
    name: Number(code, arrow, int(code[1]))
    for name, code, arrow in (
        ("bool", "u1", pa.bool_()),
        ("byte", "u1", pa.uint8()),
        ("octet", "u1", pa.uint8()),
        ("char", "u1", pa.uint8()),
        ("int8", "i1", pa.int8()),
        ("uint8", "u1", pa.uint8()),
        ("int16", "i2", pa.int16()),
        ("uint16", "u2", pa.uint16()),
        ("int32", "i4", pa.int32()),
        ("uint32", "u4", pa.uint32()),
        ("int64", "i8", pa.int64()),
        ("uint64", "u8", pa.uint64()),
        ("float32", "f4", pa.float32()),
        ("float64", "f8", pa.float64()),
    )
}


def size_of_many(each: tuple[int, ...], count: int, place: int) -> int:
    """Return how many bytes equal elements take, given the sizes of one; see Sizes."""
    if not count:
        return 0
    first = each[place % _LARGEST_ALIGNMENT]
    # From the second on all take the same: each begins where one ends, at the same distance from its last alignment.
    return first + (count - 1) * each[(place + first) % _LARGEST_ALIGNMENT]


def _size_of_all(parts: Sequence[Sizes]) -> Sizes:
    """Return the sizes of fields that follow each other. To rosbags, as to rosidl, each message has at least one."""
    sizes = []
    for place in range(_LARGEST_ALIGNMENT):
        end = place
        for part in parts:
            if part is None:
                return None
            end += part[end % _LARGEST_ALIGNMENT]
        sizes.append(end - place)
    return tuple(sizes)


def type_tree(store: Typestore, type_name: str) -> Struct:
    """Return the tree of a type that a store knows; raises BagError for a field that cannot be decoded."""
    fields = store.fielddefs[type_name][1]
    return Struct(type_name, tuple(Field(name, _node(store, type_name, what)) for name, what in fields))


def _node(store: Typestore, owner: str, description: Any) -> Node:
    kind, what = description
    if kind == Nodetype.NAME:
        return type_tree(store, what)
    if kind == Nodetype.BASE:
        name, _ = what
        if name == "string":
            return Text()
        if name not in _NUMBERS:
            raise BagError(f"{owner} has a field of type {name}, which cannot be decoded: use --raw, or --fields")
        return _NUMBERS[name]
    element, count = what
    node = _node(store, owner, element)
    return Array(node, count) if kind == Nodetype.ARRAY else Run(node)


def only(tree: Struct, paths: Sequence[str], topic: str) -> Struct:
    """Return a tree of which only these fields, named by dotted paths, are asked for.

    The path of a field within the elements of an array does not name the array's elements. Raises BagError for a field
    that is not there.
    """
    asked: dict[str, list[str]] = {}
    for path in paths:
        name, _, rest = path.partition(".")
        asked.setdefault(name, []).append(rest)
    names = [field.name for field in tree.fields]
    for name in asked:
        if name not in names:
            raise BagError(
                f"{topic}: {tree.type} has no field `{name}`{did_you_mean(name, names)}; it has {', '.join(names)}"
            )
    return replace(
        tree,
        fields=tuple(
            replace(field, node=_narrowed(field, asked[field.name], topic))
            if field.name in asked
            else replace(field, is_wanted=False)
            for field in tree.fields
        ),
    )


def _narrowed(field: Field, rests: Sequence[str], topic: str) -> Node:
    return field.node if "" in rests else _narrowed_node(field.node, rests, field.name, topic)


def _narrowed_node(node: Node, rests: Sequence[str], name: str, topic: str) -> Node:
    if isinstance(node, Struct):
        return only(node, rests, topic)
    if isinstance(node, Array | Run):
        return replace(node, element=_narrowed_node(node.element, rests, name, topic))
    raise BagError(f"{topic}: `{name}` is a value and has no field `{rests[0]}`")


def is_empty(node: Node) -> bool:
    """Tell whether a tree has no field that is asked for."""
    if isinstance(node, Array | Run):
        return is_empty(node.element)
    return isinstance(node, Struct) and not any(field.is_wanted and not is_empty(field.node) for field in node.fields)


def arrow_type(node: Node) -> pa.DataType:
    """Return a tree's Arrow type. Fields of a known unit have it in their metadata (`unit`)."""
    match node:
        case Number():
            return node.arrow
        case Text():
            return pa.string()
        case Array():
            return pa.list_(arrow_type(node.element), node.count)
        case Run():
            return pa.binary() if node.is_bytes else pa.list_(arrow_type(node.element))
        case Struct():
            return pa.struct(
                [
                    _arrow_field(node.type, field)
                    for field in node.fields
                    if field.is_wanted and not is_empty(field.node)
                ]
            )


def _arrow_field(type_name: str, field: Field) -> pa.Field:
    unit = unit_of(type_name, field.name)
    metadata: Mapping[str, str] | None = {"unit": unit} if unit else None
    return pa.field(field.name, arrow_type(field.node), metadata=metadata)
