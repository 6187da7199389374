"""A policy of its own: at each message of the lead, the nearest of every other input."""

from typing import Literal

from pydantic import Field

from led_by.matching import LedBy
from syncrelay.config.keys import Duration, TopicName
from syncrelay.config.models import Group, Inputs, Tolerance, Topic, Topics


class LedByGroup(Group):
    """At each message of the lead, the nearest of every other input."""

    trigger_key = "lead"

    policy: Literal["led_by"] = Field(description="At each message of the lead, the nearest of every other input.")
    lead: TopicName = Field(description="Input whose every message makes a set.", examples=["/camera/image_raw"])
    reach: Duration = Field(description="Largest span of a set, inclusive.", examples=["20ms"])
    topics: tuple[Topic, ...] = Topics

    @property
    def tolerance(self) -> Tolerance:
        return Tolerance("reach", self.reach)

    def build_policy(self, inputs: Inputs) -> LedBy:
        lead = inputs.index_of(self.lead)
        return LedBy(n_inputs=len(self.topics), queue_size=self.queue_size, lead=lead, reach_ns=self.reach)
