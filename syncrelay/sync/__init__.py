"""The engine: messages in, matched sets and drops out. No clock, thread, ROS or configuration in here."""

from syncrelay.sync.approximate_epsilon_time import ApproximateEpsilonTime
from syncrelay.sync.approximate_time import ApproximateTime
from syncrelay.sync.approximate_time_eager import ApproximateTimeEager
from syncrelay.sync.counts import InputCounts
from syncrelay.sync.equal_key import EqualKey
from syncrelay.sync.exact_time import ExactTime
from syncrelay.sync.group import SyncGroup
from syncrelay.sync.latest_at_ticks import LatestAtTicks
from syncrelay.sync.latest_time import LatestTime
from syncrelay.sync.messages import Drop, DropReason, Match, Message, Outcome, Restamp
from syncrelay.sync.optional import OptionalInputs
from syncrelay.sync.policy import Policy
from syncrelay.sync.queues import StampQueue
from syncrelay.sync.ticks import Ticks
from syncrelay.sync.transforms import Lack, Lapse, Missing, Transforms

__all__ = [
    "ApproximateEpsilonTime",
    "ApproximateTime",
    "ApproximateTimeEager",
    "Drop",
    "DropReason",
    "EqualKey",
    "ExactTime",
    "InputCounts",
    "Lack",
    "Lapse",
    "LatestAtTicks",
    "LatestTime",
    "Match",
    "Message",
    "Missing",
    "OptionalInputs",
    "Outcome",
    "Policy",
    "Restamp",
    "StampQueue",
    "SyncGroup",
    "Ticks",
    "Transforms",
]
