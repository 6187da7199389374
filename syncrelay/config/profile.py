"""QoS profiles: what the file asks for, filled in with what publishers offer; and whether two of them connect."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

from syncrelay.config.qos import QosOverrides, QosPreset

UNSET: Final = 0
"""rclpy's default of every duration, which rosbag2 writes too: there is no limit."""
_BEST: Final = "best_available"
_BEST_NS: Final = 9_223_372_036_854_775_806
# The DDS history, not queue_size: deep enough for an input of 200 Hz to lose nothing in a stall of half a second.
_DEPTH: Final = 100
# Fast DDS keeps as many with keep_all.
_KEPT: Final = 5000
# Of each policy, from the least to the most: a publisher must offer at least what is requested. DDS's liveliness by
# participant, which ROS has no name for, is the unknown one.
_RANKS: Final = {
    "reliability": ("best_effort", "reliable"),
    "durability": ("volatile", "transient_local"),
    "liveliness": ("automatic", "unknown", "manual_by_topic"),
}
_DURATIONS: Final = ("deadline", "liveliness_lease_duration")


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
        reliability=_BEST,
        durability=_BEST,
        deadline=_BEST_NS,
        liveliness=_BEST,
        liveliness_lease_duration=_BEST_NS,
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

    It is reliable only if all publishers are, transient_local only if all are. So it is with every policy that is to
    be `best_available`.
    """
    profile = _asked(asked)
    best: dict[str, Any] = {policy: _most(policy, offered) for policy in _open(profile)}
    return replace(profile, **best)


def _asked(asked: QosPreset | QosOverrides) -> Profile:
    if isinstance(asked, QosPreset):
        return PRESETS[asked.name]
    return replace(Profile(depth=_DEPTH, reliability=_BEST, durability=_BEST), **asked.model_dump(exclude_none=True))


def _open(profile: Profile) -> list[str]:
    """Return the policies that publishers decide.

    rmw would decide them once, as the subscription is made. Without a publisher it takes the most of each, and those
    that start later and offer less are never heard.
    """
    return [policy for policy in (*_RANKS, *_DURATIONS) if getattr(profile, policy) in (_BEST, _BEST_NS)]


def _most(policy: str, offered: Sequence[Profile]) -> str | int:
    """Return the most of a policy that can be requested of every publisher."""
    values = [getattr(each, policy) for each in offered]
    if policy in _DURATIONS:
        return UNSET if UNSET in values else max(values, default=UNSET)
    if policy == "reliability":
        return "best_effort" if "best_effort" in values else "reliable"
    least, *_, most = _RANKS[policy]
    return most if values and all(value == most for value in values) else least


def _reaches(policy: str, offer: str, request: str) -> bool:
    ranks = _RANKS[policy]
    return not (offer in ranks and request in ranks and ranks.index(offer) < ranks.index(request))


def is_known(asked: QosPreset | QosOverrides, offered: Sequence[Profile]) -> bool:
    """Whether `matched` needs no more than there is: without publishers, only if the file says all that they decide."""
    return bool(offered) or not _open(_asked(asked))


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
    for policy in _RANKS:
        offer, request = getattr(offered, policy), getattr(requested, policy)
        if not _reaches(policy, offer, request):
            return Mismatch(policy, offer, request)
    for policy in _DURATIONS:
        offer, request = getattr(offered, policy), getattr(requested, policy)
        if request and (not offer or offer > request):
            return Mismatch(policy, f"{offer / 1e6:g}ms" if offer else "none", f"{request / 1e6:g}ms")
    return None
