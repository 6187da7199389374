"""Names that recorders write, in the form of ROS 2."""

import re
from typing import Final

# Renamed in ROS 2, with the same fields.
_RENAMED: Final = {"tf/msg/tfMessage": "tf2_msgs/msg/TFMessage"}


def topic_name(recorded: str) -> str:
    """Return a topic name with its leading slash, which some recorders leave out."""
    return recorded if recorded.startswith("/") else f"/{recorded}"


def full_type_name(recorded: str) -> str:
    """Return the full type name for ROS 1's `pkg/Name`; a full name is returned unchanged."""
    package, slash, name = recorded.partition("/")
    full = f"{package}/msg/{name}" if slash and "/" not in name else recorded
    return _RENAMED.get(full, full)


def natural(name: str) -> list[tuple[int, str]]:
    """Return a sort key by which numbers in names count: _9 before _10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)]
