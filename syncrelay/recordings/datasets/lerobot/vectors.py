"""Numbers of messages as rows of vectors: what `TOPIC:FIELD` names, flat, each value with a name."""

from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from syncrelay.config import ExportSource
from syncrelay.errors import BagError

JOINTS: Final = "sensor_msgs/msg/JointState"
NAME: Final = "name"
"""The field that says whose each of its values is."""

_BY_JOINT: Final = ("position", "velocity", "effort")


def has_joint_names(type_name: str, field: str) -> bool:
    """Tell whether a field's values are of joints that the message names."""
    return type_name == JOINTS and field in _BY_JOINT


def field_of(messages: pa.StructArray, source: ExportSource) -> pa.Array:
    """Return a source's field of each message. Raises BagError where its path leads through a list."""
    found: pa.Array = messages
    for step in (source.field or "").split("."):
        if not pa.types.is_struct(found.type):
            raise BagError(f"{source}: `{step}` is looked for in {found.type}, expected a message")
        found = pc.struct_field(found, step)
    return found


class _Leaf(NamedTuple):
    """Values of a field, a row a message, and what stands behind the field's own name for each."""

    values: np.ndarray[Any, Any]
    suffixes: tuple[str, ...]


class VectorSource:
    """A source of a vector: gives rows of one width, whose values have the same names in every row."""

    def __init__(self, source: ExportSource, type_name: str) -> None:
        self.source: Final = source
        self.names: tuple[str, ...] = ()
        """The name of each value; empty until the first row."""
        self._field: Final = source.field or ""
        self._has_joints = has_joint_names(type_name, self._field)
        self._joints: list[str] = []

    def rows(self, messages: pa.StructArray) -> np.ndarray[Any, Any]:
        """Return the values of messages, none of which is null, as [message, value] in float64.

        Raises BagError for what is no numbers, and where a message has others than those before it.
        """
        found = field_of(messages, self.source)
        leaves = list(self._leaves(found, ""))
        values = np.concatenate([leaf.values for leaf in leaves], axis=1)
        suffixes = tuple(suffix for leaf in leaves for suffix in leaf.suffixes)
        if self._has_joints:
            return self._by_joint(values, pc.struct_field(messages, NAME))
        self._expect(tuple(f"{self._field}{suffix}" for suffix in suffixes), values.shape[1])
        return values

    def _leaves(self, found: pa.Array, suffix: str) -> Iterator[_Leaf]:
        kind = found.type
        if pa.types.is_struct(kind) and kind.num_fields:
            for index, field in enumerate(kind):
                yield from self._leaves(pc.struct_field(found, index), f"{suffix}.{field.name}")
        elif pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind):
            values = self._numbers(found.flatten())
            width = self._width(found)
            yield _Leaf(values.reshape(len(found), width), tuple(f"{suffix}.{place}" for place in range(width)))
        else:
            yield _Leaf(self._numbers(found).reshape(len(found), 1), (suffix,))

    def _numbers(self, values: pa.Array) -> np.ndarray[Any, Any]:
        kind = values.type
        if not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind)):
            what = "a list of messages" if pa.types.is_struct(kind) else str(kind)
            raise BagError(f"{self.source} is {what}, expected numbers")
        found: np.ndarray[Any, Any] = values.to_numpy(zero_copy_only=False).astype(np.float64)
        return found

    def _width(self, lists: pa.Array) -> int:
        widths = pc.unique(pc.list_value_length(lists)).to_pylist()
        if len(widths) > 1:
            raise self._other_width(*widths[:2])
        if not widths[0]:
            raise BagError(f"{self.source} has no values, expected one or more in every message")
        return int(widths[0])

    def _expect(self, names: tuple[str, ...], width: int) -> None:
        if not self.names:
            self.names = names
        elif width != len(self.names):
            raise self._other_width(len(self.names), width)

    def _by_joint(self, values: np.ndarray[Any, Any], named: pa.ListArray) -> np.ndarray[Any, Any]:
        """Return values in the order of the first message's joints, whatever their order in others."""
        rows = named.to_pylist()
        if not self._joints:
            # Some drivers name none.
            self._joints = rows[0] or [f"joint{number}" for number in range(values.shape[1])]
        self._expect(tuple(f"{joint}.{self._field}" for joint in self._joints), values.shape[1])
        if len(self._joints) != values.shape[1]:
            raise BagError(f"{self.source} has {values.shape[1]} values for {len(self._joints)} names")
        places = {joint: place for place, joint in enumerate(self._joints)}
        ordered = values
        for number, joints in enumerate(rows):
            if joints and joints != self._joints:
                if len(joints) != len(places) or set(joints) != places.keys():
                    raise BagError(
                        f"{self.source} is of {', '.join(joints)} in one message and of {', '.join(self._joints)} in"
                        " another: every frame needs the same joints"
                    )
                ordered = values.copy() if ordered is values else ordered
                ordered[number, [places[joint] for joint in joints]] = values[number]
        return ordered

    def _other_width(self, one: int, other: int) -> BagError:
        return BagError(
            f"{self.source} has {one} values in one message and {other} in another: every frame needs as many"
        )


def joined_names(sources: Sequence[VectorSource]) -> list[str]:
    """Return a vector's names: fields and what is below them; with topics where two would be the same."""
    names = [name for source in sources for name in source.names]
    if len(set(names)) == len(names):
        return names
    return [f"{source.source.topic.strip('/')}.{name}" for source in sources for name in source.names]
