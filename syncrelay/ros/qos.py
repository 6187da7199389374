"""QoS: what the file asks for, filled in with what publishers offer."""

from collections.abc import Sequence
from copy import copy
from typing import Any

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

# The DDS history, not queue_size: deep enough for an input of 200 Hz to lose nothing in a stall of half a second.
_DEPTH = 100

# Fast DDS keeps as many with keep_all.
_KEPT = 5000


def input_profile(asked: QosPreset | QosOverrides, offered: Sequence[QoSProfile]) -> QoSProfile | None:
    """Return the QoS to subscribe with: what the file says, and for the rest what every publisher can serve.

    It is reliable only if all publishers are, transient_local only if all are. Return None while that is not known,
    because there is no publisher.
    """
    if isinstance(asked, QosPreset):
        return QoSPresetProfiles.get_from_short_key(asked.name)
    policies = _asked_policies(asked)
    if not offered and not {"reliability", "durability"} <= policies.keys():
        return None
    is_reliable = all(each.reliability == QoSReliabilityPolicy.RELIABLE for each in offered)
    is_latched = all(each.durability == QoSDurabilityPolicy.TRANSIENT_LOCAL for each in offered)
    served_by_all = {
        "reliability": QoSReliabilityPolicy.RELIABLE if is_reliable else QoSReliabilityPolicy.BEST_EFFORT,
        "durability": QoSDurabilityPolicy.TRANSIENT_LOCAL if is_latched else QoSDurabilityPolicy.VOLATILE,
    }
    return QoSProfile(**{"depth": _DEPTH, **served_by_all, **policies})


def output_profile(received: QoSProfile) -> QoSProfile:
    """Return the QoS to publish with: that of the input, except for keep_all.

    A publisher with keep_all waits for its slowest subscriber, and fails if that is stuck. So the output keeps only the
    last 5000 messages.
    """
    if received.history != QoSHistoryPolicy.KEEP_ALL:
        return received
    sent = copy(received)
    sent.history, sent.depth = QoSHistoryPolicy.KEEP_LAST, _KEPT
    return sent


_NAMED = {
    "history": QoSHistoryPolicy,
    "reliability": QoSReliabilityPolicy,
    "durability": QoSDurabilityPolicy,
    "liveliness": QoSLivelinessPolicy,
}


def _asked_policies(asked: QosOverrides) -> dict[str, Any]:
    policies = asked.model_dump(exclude_none=True)
    named = {key: _NAMED[key].get_from_short_key(policies[key]) for key in _NAMED if key in policies}
    durations = {
        key: Duration(nanoseconds=policies[key])
        for key in ("deadline", "lifespan", "liveliness_lease_duration")
        if key in policies
    }
    return policies | named | durations
