"""QoS profiles: what the file asks for, filled in with what publishers offer; and whether two of them connect."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

from syncrelay.config.qos import QosOverrides, QosPreset

UNSET: Final = 0
"""rclpy's default of every duration, which rosbag2 writes too: there is no limit."""
_BEST_AVAILABLE_NS: Final = 9_223_372_036_854_775_806
# The DDS history, not queue_size: deep enough for an input of 200 Hz to lose nothing in a stall of half a second.
_DEPTH: Final = 100
# Fast DDS keeps as many with keep_all.
_KEPT: Final = 5000
# Of each policy, what is less and what is more: a publisher must offer at least what is requested.
_RANKS: Final = {
    "reliability": ("best_effort", "reliable"),
    "durability": ("volatile", "transient_local"),
    "liveliness": ("automatic", "manual_by_topic"),
}


@dataclass(frozen=True, slots=True)
class Profile:
    """A QoS profile by rosbag2's keys; durations in nanoseconds, 0 where there is no limit."""

    history: str = "keep_last"
    depth: int = 10
    reliability: str = "reliable"
    durability: str = "volatile"
    deadline: int = UNSET
    lifespan: int = UNSET
    liveliness: str = "system_default"
    liveliness_lease_duration: int = UNSET
    avoid_ros_namespace_conventions: bool = False


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
"""The presets that a file can name, as rclpy.qos.QoSPresetProfiles has them."""


class Mismatch(NamedTuple):
    """A QoS policy by which a publisher and a subscriber do not connect, in DDS's words: offered and requested."""

    policy: str
    offered: str
    requested: str


def matched(asked: QosPreset | QosOverrides, offered: Sequence[Profile]) -> Profile:
    """Return what the file asks for, and for the rest what every publisher can serve.

    It is reliable only if all publishers are, transient_local only if all are.
    """
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


def is_known(asked: QosPreset | QosOverrides, offered: Sequence[Profile]) -> bool:
    """Whether `matched` needs no more than there is: without publishers, only if the file says all that they decide."""
    if offered or isinstance(asked, QosPreset):
        return True
    return asked.reliability is not None and asked.durability is not None


def sent(received: Profile) -> Profile:
    """Return the profile to publish with what was subscribed with another: that, except for keep_all.

    A publisher with keep_all waits for its slowest subscriber, and fails if that is stuck. So the output keeps only the
    last 5000 messages.
    """
    return replace(received, history="keep_last", depth=_KEPT) if received.history == "keep_all" else received


def mismatch(offered: Profile, requested: Profile) -> Mismatch | None:
    """Return the first policy by which a publisher and a subscriber do not connect, None if they do.

    The rules are those of DDS 1.4, section 2.2.3.
    """
    for policy, (less, more) in _RANKS.items():
        if getattr(offered, policy) == less and getattr(requested, policy) == more:
            return Mismatch(policy, less, more)
    for policy in ("deadline", "liveliness_lease_duration"):
        offer, request = getattr(offered, policy), getattr(requested, policy)
        if request and request != _BEST_AVAILABLE_NS and (not offer or offer > request):
            return Mismatch(policy, f"{offer / 1e6:g}ms" if offer else "none", f"{request / 1e6:g}ms")
    return None
