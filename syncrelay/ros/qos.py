"""QoS profiles as rclpy has them."""

from dataclasses import asdict
from typing import Any, Final

from rclpy.duration import Duration
from rclpy.qos import (
    QoSDurabilityPolicy,
    QoSHistoryPolicy,
    QoSLivelinessPolicy,
    QoSProfile,
    QoSReliabilityPolicy,
)

from syncrelay.config.profile import UNSET, Profile

_NAMED: Final = {
    "history": QoSHistoryPolicy,
    "reliability": QoSReliabilityPolicy,
    "durability": QoSDurabilityPolicy,
    "liveliness": QoSLivelinessPolicy,
}
_DURATIONS: Final = ("deadline", "lifespan", "liveliness_lease_duration")
_ENDLESS: Final = 2**63 - 1


def to_rclpy(profile: Profile) -> QoSProfile:
    """Return a profile as rclpy takes it."""
    policies = asdict(profile)
    policies |= {key: named.get_from_short_key(policies[key]) for key, named in _NAMED.items()}
    return QoSProfile(**policies | {key: Duration(nanoseconds=policies[key]) for key in _DURATIONS})


def from_rclpy(profile: QoSProfile) -> Profile:
    """Return a profile of rclpy's, as of an endpoint in the graph."""
    policies: dict[str, Any] = {key: getattr(profile, key).short_key for key in _NAMED}
    policies |= {key: _nanoseconds(getattr(profile, key)) for key in _DURATIONS}
    conventions = profile.avoid_ros_namespace_conventions
    return Profile(**policies, depth=profile.depth, avoid_ros_namespace_conventions=conventions)


def _nanoseconds(duration: Any) -> int:
    """Return a policy's duration, UNSET where it is unset or without end."""
    nanoseconds = int(duration.nanoseconds)
    return UNSET if nanoseconds >= _ENDLESS or nanoseconds < 0 else nanoseconds
