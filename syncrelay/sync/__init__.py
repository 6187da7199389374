"""The engine: messages in, matched sets and drops out. No clock, thread, ROS or configuration in here."""

from syncrelay.sync.approximate_time import ApproximateTime
from syncrelay.sync.counts import InputCounts
from syncrelay.sync.exact_time import ExactTime
from syncrelay.sync.group import SyncGroup
from syncrelay.sync.messages import Drop, DropReason, Match, Message, Outcome
from syncrelay.sync.policy import Policy
from syncrelay.sync.restamp import Restamp

__all__ = [
    "ApproximateTime",
    "Drop",
    "DropReason",
    "ExactTime",
    "InputCounts",
    "Match",
    "Message",
    "Outcome",
    "Policy",
    "Restamp",
    "SyncGroup",
]
