"""QoS: what the file asks for, filled in with what publishers offer."""

from collections.abc import Sequence
from typing import Any, TypeAlias

from rclpy.duration import Duration
from rclpy.qos import (
    QoSDurabilityPolicy,
    QoSHistoryPolicy,
    QoSLivelinessPolicy,
    QoSPresetProfiles,
    QoSProfile,
    QoSReliabilityPolicy,
)

from syncrelay.config import QosOverrides, QosPreset

# DDS history, not queue_size: deep enough that a hiccup of half a second costs a 200 Hz input nothing.
_DEPTH = 100

# As many as Fast DDS keeps where it is to keep all.
_KEPT = 5000

_Policies: TypeAlias = dict[str, Any]


def input_profile(asked: QosPreset | QosOverrides, offered: Sequence[QoSProfile]) -> QoSProfile | None:
    """What to subscribe with: what the file asks for, and the rest so that every publisher can serve it.

    Reliable only if all publishers are, transient_local only if all are. None as long as that cannot be
    known, because no publisher is there.
    """
    if isinstance(asked, QosPreset):
        return QoSPresetProfiles.get_from_short_key(asked.name)
    policies = _asked_policies(asked)
    if not offered and not {"reliability", "durability"} <= policies.keys():
        return None
    return QoSProfile(**{"depth": _DEPTH, **_served_by_all(offered), **policies})


def output_profile(received: QoSProfile) -> QoSProfile:
    """What to publish with: what a topic is received with, but so that no subscriber can hold the relay up.

    A publisher that keeps all waits for the slowest subscriber, and fails when that hangs. So the last are kept.
    """
    if received.history != QoSHistoryPolicy.KEEP_ALL:
        return received
    policies = {name: getattr(received, name) for name in _OUTPUT_POLICIES}
    return QoSProfile(history=QoSHistoryPolicy.KEEP_LAST, depth=_KEPT, **policies)


_OUTPUT_POLICIES = (
    "reliability",
    "durability",
    "deadline",
    "lifespan",
    "liveliness",
    "liveliness_lease_duration",
    "avoid_ros_namespace_conventions",
)


def _served_by_all(offered: Sequence[QoSProfile]) -> _Policies:
    reliable = all(each.reliability == QoSReliabilityPolicy.RELIABLE for each in offered)
    latched = all(each.durability == QoSDurabilityPolicy.TRANSIENT_LOCAL for each in offered)
    return {
        "reliability": QoSReliabilityPolicy.RELIABLE if reliable else QoSReliabilityPolicy.BEST_EFFORT,
        "durability": QoSDurabilityPolicy.TRANSIENT_LOCAL if latched else QoSDurabilityPolicy.VOLATILE,
    }


_NAMED = {
    "history": QoSHistoryPolicy,
    "reliability": QoSReliabilityPolicy,
    "durability": QoSDurabilityPolicy,
    "liveliness": QoSLivelinessPolicy,
}


def _asked_policies(asked: QosOverrides) -> _Policies:
    policies = asked.model_dump(exclude_none=True)
    named = {key: _NAMED[key].get_from_short_key(policies[key]) for key in _NAMED if key in policies}
    durations = {
        key: Duration(nanoseconds=policies[key])
        for key in ("deadline", "lifespan", "liveliness_lease_duration")
        if key in policies
    }
    return policies | named | durations
