"""QoS profiles in recordings: read, and written as rosbag2 does (version 9)."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, Final

import yaml

from syncrelay.config.profile import UNSET, Profile
from syncrelay.config.yaml_tree import LOADER

_NS_PER_SECOND: Final = 1_000_000_000
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
        return UNSET
