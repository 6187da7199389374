"""Names as recorders write them, brought to the form of ROS 2."""

import re
from typing import Final

# Renamed in ROS 2; the layout is the same.
_RENAMED: Final = {"tf/msg/tfMessage": "tf2_msgs/msg/TFMessage"}


def topic_name(recorded: str) -> str:
    """Return a topic's name with the slash that some recorders leave out."""
    return recorded if recorded.startswith("/") else f"/{recorded}"


def full_type_name(recorded: str) -> str:
    """Return ROS 1's `pkg/Name` as ROS 2 writes it; a full name as it is."""
    package, slash, name = recorded.partition("/")
    full = f"{package}/msg/{name}" if slash and "/" not in name else recorded
    return _RENAMED.get(full, full)


def natural(name: str) -> list[tuple[int, str]]:
    """Return what sorts split files by their numbers: _9 before _10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)]
