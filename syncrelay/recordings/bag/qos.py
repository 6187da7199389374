"""QoS profiles in recordings: read, combined with what a file asks for, and written as rosbag2 does (version 9)."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Final

import yaml

from syncrelay.config import QosOverrides, QosPreset
from syncrelay.config.yaml_tree import LOADER

# rclpy's default for every duration, which rosbag2 writes too: 0 means no limit.
_UNSET: Final = 0
_NS_PER_SECOND: Final = 1_000_000_000
# The depth of the relay's subscriptions (syncrelay.ros.qos).
_DEPTH: Final = 100
# Older files have the numbers of rmw/types.h instead of names.
_NAMES: Final[Mapping[str, Sequence[str]]] = {
    "history": ("system_default", "keep_last", "keep_all", "unknown"),
    "reliability": ("system_default", "reliable", "best_effort", "unknown", "best_available"),
    "durability": ("system_default", "transient_local", "volatile", "unknown", "best_available"),
    "liveliness": ("system_default", "automatic", "manual_by_node", "manual_by_topic", "unknown", "best_available"),
}
# List, profile, duration: real texts nest no deeper.
_DEEPEST: Final = 5
_LONGEST: Final = 100_000
_DURATIONS: Final = ("deadline", "lifespan", "liveliness_lease_duration")


@dataclass(frozen=True, slots=True)
class Profile:
    """A QoS profile by rosbag2's keys; durations in nanoseconds, 0 where there is no limit."""

    history: str = "keep_last"
    depth: int = 10
    reliability: str = "reliable"
    durability: str = "volatile"
    deadline: int = _UNSET
    lifespan: int = _UNSET
    liveliness: str = "system_default"
    liveliness_lease_duration: int = _UNSET
    avoid_ros_namespace_conventions: bool = False


_BEST_AVAILABLE_NS: Final = 9_223_372_036_854_775_806
# rclpy's presets (rclpy.qos.QoSPresetProfiles).
PRESETS: Final[Mapping[str, Profile]] = {
    "system_default": Profile("system_default", 0, "system_default", "system_default"),
    "default": Profile(),
    "sensor_data": Profile(depth=5, reliability="best_effort"),
    "services_default": Profile(),
    "parameters": Profile(depth=1000),
    "parameter_events": Profile(depth=1000),
    "action_status_default": Profile(depth=1, durability="transient_local"),
    "best_available": Profile(
        reliability="best_available",
        durability="best_available",
        deadline=_BEST_AVAILABLE_NS,
        liveliness="best_available",
        liveliness_lease_duration=_BEST_AVAILABLE_NS,
    ),
}
"""The presets that a file can name."""


def output_profile(asked: QosPreset | QosOverrides, offered: Sequence[Profile]) -> Profile:
    """Return the profile of the relay's output: what the file asks for, and what all publishers can serve."""
    if isinstance(asked, QosPreset):
        return PRESETS[asked.name]
    served = Profile(
        depth=_DEPTH,
        reliability="reliable" if all(each.reliability != "best_effort" for each in offered) else "best_effort",
        durability="transient_local"
        if offered and all(each.durability == "transient_local" for each in offered)
        else "volatile",
    )
    return replace(served, **asked.model_dump(exclude_none=True))


def read_profiles(recorded: str) -> tuple[Profile, ...]:
    """Return the profiles in a YAML text, `offered_qos_profiles`; none if it cannot be read."""
    listed = plain_yaml(recorded, longest=_LONGEST, deepest=_DEEPEST)
    if not isinstance(listed, list):
        return ()
    return tuple(_read_profile(each) for each in listed if isinstance(each, dict))


def plain_yaml(text: str, *, longest: int, deepest: int) -> Any:
    """Return the value of a YAML text; None if it is faulty, too long, too deeply nested, or has aliases or tags.

    Aliases can expand to gigabytes, and for a value that does not fit its tag PyYAML may raise anything.
    """
    try:
        is_plain = len(text) <= longest and _is_plain(text, deepest)
        return yaml.load(text, Loader=LOADER) if is_plain else None  # noqa: S506  a safe one
    except (yaml.YAMLError, ValueError, OverflowError):
        return None


def _is_plain(text: str, deepest: int) -> bool:
    depth = 0
    for event in yaml.parse(text, Loader=LOADER):
        if isinstance(event, yaml.AliasEvent) or getattr(event, "tag", None) is not None:
            return False
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > deepest:
            return False
    return True


def write_profile(profile: Profile) -> dict[str, Any]:
    """Return a profile as rosbag2 writes it."""
    written = asdict(profile)
    for key in _DURATIONS:
        seconds, nanoseconds = divmod(written[key], _NS_PER_SECOND)
        written[key] = {"sec": seconds, "nsec": nanoseconds}
    return written


def _read_profile(recorded: Mapping[str, Any]) -> Profile:
    known: dict[str, Any] = {key: _name(key, recorded[key]) for key in _NAMES if key in recorded}
    known |= {key: _nanoseconds(recorded[key]) for key in _DURATIONS if key in recorded}
    if isinstance(recorded.get("depth"), int):
        known["depth"] = recorded["depth"]
    return Profile(**known)


def _name(key: str, value: Any) -> str:
    names = _NAMES[key]
    if isinstance(value, int):
        return names[value] if 0 <= value < len(names) else "unknown"
    return value if value in names else "unknown"


def _nanoseconds(value: Any) -> int:
    try:
        return int(value["sec"]) * _NS_PER_SECOND + int(value["nsec"])
    except (KeyError, TypeError, ValueError, OverflowError):
        return _UNSET
