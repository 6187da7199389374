"""Numbers of messages as rows of a vector: all numbers of a field, flat, each with a name."""

from collections.abc import Iterator, Sequence
from typing import Any, Final, TypeAlias

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from syncrelay.config import ExportSource
from syncrelay.errors import BagError

NAME: Final = "name"
"""The field of a JointState that names the joint of each value."""

_JOINTS: Final = "sensor_msgs/msg/JointState"
_BY_JOINT: Final = ("position", "velocity", "effort")

Rows: TypeAlias = np.ndarray[Any, Any]


def has_joint_names(type_name: str, field: str) -> bool:
    """Tell whether a field's values are of joints that the message names."""
    return type_name == _JOINTS and field in _BY_JOINT


def field_of(messages: pa.StructArray, source: ExportSource) -> pa.Array:
    """Return a source's field of each message. Raises BagError where its path leads through a list."""
    found: pa.Array = messages
    for step in (source.field or "").split("."):
        if not pa.types.is_struct(found.type):
            raise BagError(f"{source}: `{step}` is looked for in {found.type}, expected a message")
        found = pc.struct_field(found, step)
    return found


class VectorSource:
    """A field that is a vector or a part of one. All its rows have the same width and the same names."""

    def __init__(self, source: ExportSource, type_name: str) -> None:
        self.source: Final = source
        self.names: tuple[str, ...] = ()
        """The name of each value; empty until the first row."""
        self._field: Final = source.field or ""
        self._has_joints = has_joint_names(type_name, self._field)
        self._joints: list[str] = []

    def rows(self, messages: pa.StructArray) -> Rows:
        """Return the values of messages, none of which is null, as [message, value] in float64.

        Raises BagError for a field that is not numbers, and where a message has other values than those before it.
        """
        columns = dict(self._columns(field_of(messages, self.source), self._field))
        values = np.stack([*columns.values()], axis=1)
        if self._has_joints:
            return self._by_joint(values, pc.struct_field(messages, NAME).to_pylist())
        self._expect(tuple(columns))
        return values

    def _columns(self, found: pa.Array, name: str) -> Iterator[tuple[str, Rows]]:
        """Yield each number of a field with its name, for all messages."""
        kind = found.type
        if pa.types.is_struct(kind) and kind.num_fields:
            for field in kind:
                yield from self._columns(pc.struct_field(found, field.name), f"{name}.{field.name}")
        elif pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind):
            values = self._numbers(found.flatten()).reshape(len(found), self._width(found))
            yield from ((f"{name}.{place}", column) for place, column in enumerate(values.T))
        else:
            yield name, self._numbers(found)

    def _numbers(self, values: pa.Array) -> Rows:
        kind = values.type
        if not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind)):
            what = "a list of messages" if pa.types.is_struct(kind) else str(kind)
            raise BagError(f"{self.source} is {what}, expected numbers")
        found: Rows = values.to_numpy(zero_copy_only=False).astype(np.float64)
        return found

    def _width(self, lists: pa.Array) -> int:
        widths = pc.unique(pc.list_value_length(lists)).to_pylist()
        if len(widths) > 1:
            raise self._other_width(*widths[:2])
        if not widths[0]:
            raise BagError(f"{self.source} has no values, expected one or more in every message")
        return int(widths[0])

    def _expect(self, names: tuple[str, ...]) -> None:
        if not self.names:
            self.names = names
        elif len(names) != len(self.names):
            raise self._other_width(len(self.names), len(names))

    def _by_joint(self, values: Rows, named: Sequence[list[str]]) -> Rows:
        """Return values in the order of the first message's joints, whatever their order in others."""
        width = values.shape[1]
        if not self._joints:
            # Some drivers do not name the joints.
            self._joints = named[0] or [f"joint{number}" for number in range(width)]
        if self.names and width != len(self.names):
            raise self._other_width(len(self.names), width)
        if len(self._joints) != width:
            raise BagError(f"{self.source} has {width} values for {len(self._joints)} names")
        self.names = tuple(f"{joint}.{self._field}" for joint in self._joints)
        places = {joint: place for place, joint in enumerate(self._joints)}
        for number, joints in enumerate(named):
            if joints and joints != self._joints:
                if len(joints) != len(places) or set(joints) != places.keys():
                    raise BagError(
                        f"{self.source} is of {', '.join(joints)} in one message and of {', '.join(self._joints)} in"
                        " another: every frame needs the same joints"
                    )
                values[number, [places[joint] for joint in joints]] = values[number].copy()
        return values

    def _other_width(self, one: int, other: int) -> BagError:
        return BagError(
            f"{self.source} has {one} values in one message and {other} in another: every frame needs as many"
        )


def joined_names(sources: Sequence[VectorSource]) -> list[str]:
    """Return the names of a vector's values: their fields', with the topic before them where two would be the same."""
    names = [name for source in sources for name in source.names]
    if len(set(names)) == len(names):
        return names
    return [f"{source.source.topic.strip('/')}.{name}" for source in sources for name in source.names]
