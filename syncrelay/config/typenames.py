"""The form of a message type's name, `package/msg/Name`, and of a path to one of its fields."""

import re
from typing import Final

from syncrelay.config.wording import describe, quoted

_FULL: Final = re.compile(r"[A-Za-z]\w*/(msg|srv|action)/[A-Za-z]\w*", re.ASCII)
_SHORT: Final = re.compile(r"([A-Za-z]\w*)/([A-Za-z]\w*)", re.ASCII)
# As Python and C++ write it.
_FOREIGN: Final = re.compile(r"([A-Za-z]\w*)(?:\.|::)msg(?:\.|::)([A-Za-z]\w*)", re.ASCII)
_PATH: Final = re.compile(r"[A-Za-z]\w*(\.[A-Za-z]\w*)*", re.ASCII)
_KINDS: Final = {"srv": "a service", "action": "an action"}


def check_type_name(name: object) -> str:
    """Return a type's name if it has the form of a message's; raises ValueError saying what is wrong."""
    if not isinstance(name, str):
        raise ValueError(f"expected a message type such as sensor_msgs/msg/Image, found {describe(name)}")  # noqa: TRY004
    full = _FULL.fullmatch(name)
    if full is not None:
        kind = _KINDS.get(full[1])
        if kind is None:
            return name
        raise ValueError(f"{quoted(name)} is {kind} type, expected a message type (package/msg/Name)")
    other = _SHORT.fullmatch(name) or _FOREIGN.fullmatch(name)
    if other is not None:
        raise ValueError(f"{quoted(name)} is not the full name, write `{other[1]}/msg/{other[2]}`")
    raise ValueError(f"{quoted(name)} is no message type, expected package/msg/Name such as sensor_msgs/msg/Image")


def check_field_path(path: str) -> str:
    """Return a path of fields if it has the form of one; raises ValueError saying what is wrong."""
    if not _PATH.fullmatch(path):
        raise ValueError(f"expected names of fields joined by dots, such as header.stamp, found {describe(path)}")
    return path
