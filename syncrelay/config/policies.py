"""The keys of a group, one model per policy, each of which makes the engine's policy from them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, Self, TypeAlias, get_args

from pydantic import Field

from syncrelay.config.keys import NOT_NULL, Duration, FieldPath, TopicName
from syncrelay.config.models import Group, KeyedTopic, NodeConfig, PacedTopic, Topic
from syncrelay.config.names import expand
from syncrelay.sync import (
    ApproximateEpsilonTime,
    ApproximateTime,
    ApproximateTimeEager,
    EqualKey,
    ExactTime,
    LatestTime,
)


@dataclass(frozen=True, slots=True)
class Inputs:
    """The absolute names of a group's inputs, and the node in whose namespace the file's names stand."""

    names: tuple[str, ...]
    node: NodeConfig

    @classmethod
    def of(cls, topics: Sequence[Topic], node: NodeConfig) -> Self:
        """Return the names of these topics."""
        return cls(tuple(expand(each.topic, node=node.name, namespace=node.namespace) for each in topics), node)

    def index_of(self, topic: str) -> int:
        """Return the index of an input that the file calls by this name."""
        return self.names.index(expand(topic, node=self.node.name, namespace=self.node.namespace))


Topics = Field(
    description="Inputs in the order in which the messages of a set leave, 2 or more.",
    json_schema_extra={"minItems": 2},
)


Slop = Field(
    description="Largest span of a set, inclusive. A number is seconds, a text has a unit (ns, us, ms, s, min).",
    examples=["20ms"],
)


class ExactTimeGroup(Group):
    """Sets of equal stamps."""

    policy: Literal["exact_time"] = Field(description="Sets of equal stamps.")
    topics: tuple[Topic, ...] = Topics

    def build_policy(self, _inputs: Inputs) -> ExactTime:
        """Return a new policy of the engine."""
        return ExactTime(n_inputs=len(self.topics), queue_size=self.queue_size)


class ApproximateTimeGroup(Group):
    """Sets of near stamps, each the best that there is."""

    policy: Literal["approximate_time"] = Field(
        description="Sets of near stamps, each the best that there is; waits until no better one can come."
    )
    slop: Duration = Slop
    age_penalty: float = Field(
        default=0.1,
        ge=0,
        allow_inf_nan=False,
        description=(
            "How much smaller a later set's span has to be for the later set to be preferred, as a fraction of the"
            " time that it comes later. Default: 0.1."
        ),
        examples=[0.1],
    )
    topics: tuple[PacedTopic, ...] = Topics

    def build_policy(self, _inputs: Inputs) -> ApproximateTime:
        """Return a new policy of the engine."""
        return ApproximateTime(
            n_inputs=len(self.topics),
            queue_size=self.queue_size,
            slop_ns=self.slop,
            age_penalty=self.age_penalty,
            min_periods_ns=tuple(topic.min_period for topic in self.topics),
        )


class ApproximateTimeEagerGroup(Group):
    """Sets of near stamps, each as soon as there is one."""

    policy: Literal["approximate_time_eager"] = Field(
        description="Sets of near stamps: the tightest that holds the message just arrived, at once."
    )
    slop: Duration = Slop
    topics: tuple[Topic, ...] = Topics

    def build_policy(self, _inputs: Inputs) -> ApproximateTimeEager:
        """Return a new policy of the engine."""
        return ApproximateTimeEager(n_inputs=len(self.topics), queue_size=self.queue_size, slop_ns=self.slop)


class ApproximateEpsilonTimeGroup(Group):
    """Sets of the oldest messages of all inputs, where these are near."""

    policy: Literal["approximate_epsilon_time"] = Field(
        description="Sets of the oldest messages of all inputs, where these lie within slop; no search for better ones."
    )
    slop: Duration = Slop
    topics: tuple[Topic, ...] = Topics

    def build_policy(self, _inputs: Inputs) -> ApproximateEpsilonTime:
        """Return a new policy of the engine."""
        return ApproximateEpsilonTime(n_inputs=len(self.topics), queue_size=self.queue_size, epsilon_ns=self.slop)


class LatestTimeGroup(Group):
    """At each message of one input, the latest of every other."""

    policy: Literal["latest_time"] = Field(
        description="At each message of the trigger, the latest not newer one of every other input."
    )
    trigger: TopicName = Field(description="Input whose every message makes a set.", examples=["/camera/image_raw"])
    max_age: Annotated[Duration | None, NOT_NULL] = Field(
        default=None,
        description=(
            "How much older than the trigger's message another may be. A number is seconds, a text has a unit"
            " (ns, us, ms, s, min). Default: no limit."
        ),
        examples=["500ms"],
    )
    topics: tuple[Topic, ...] = Topics

    def build_policy(self, inputs: Inputs) -> LatestTime:
        """Return a new policy of the engine."""
        return LatestTime(
            n_inputs=len(self.topics),
            queue_size=self.queue_size,
            trigger=inputs.index_of(self.trigger),
            max_age_ns=self.max_age,
        )


class EqualKeyGroup(Group):
    """Sets of equal values of a field."""

    policy: Literal["equal_key"] = Field(
        description="Sets of equal values of a field, such as a sequence number, an id or a frame name."
    )
    key: Annotated[FieldPath | None, NOT_NULL] = Field(
        default=None,
        description="Path of the field to match by, fields joined by dots: a number, a text or a time. Default: none,"
        " every topic has a `key` of its own.",
        examples=["header.frame_id"],
    )
    topics: tuple[KeyedTopic, ...] = Topics

    def build_policy(self, _inputs: Inputs) -> EqualKey:
        """Return a new policy of the engine."""
        return EqualKey(n_inputs=len(self.topics), queue_size=self.queue_size)


AnyGroup: TypeAlias = (
    ExactTimeGroup
    | ApproximateTimeGroup
    | ApproximateTimeEagerGroup
    | ApproximateEpsilonTimeGroup
    | LatestTimeGroup
    | EqualKeyGroup
)
GROUP_MODELS: tuple[type[AnyGroup], ...] = get_args(AnyGroup)
