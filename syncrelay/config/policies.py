"""The keys of a group, one model per policy, each of which makes the engine's policy from them."""

from typing import Literal, TypeAlias, get_args

from pydantic import Field

from syncrelay.config.keys import Duration
from syncrelay.config.models import Group, PacedTopic, Topic
from syncrelay.sync import ApproximateTime, ExactTime

Topics = Field(
    description="Inputs in the order in which the messages of a set leave, 2 or more.",
    json_schema_extra={"minItems": 2},
)


class ExactTimeGroup(Group):
    """Sets of equal stamps."""

    policy: Literal["exact_time"] = Field(description="Sets of equal stamps.")
    topics: tuple[Topic, ...] = Topics

    def matcher(self) -> ExactTime:
        """Return a new policy of the engine."""
        return ExactTime(n_inputs=len(self.topics), queue_size=self.queue_size)


class ApproximateTimeGroup(Group):
    """Sets of near stamps, each the best that there is."""

    policy: Literal["approximate_time"] = Field(
        description="Sets of near stamps, each the best that there is; waits until no better one can come."
    )
    slop: Duration = Field(
        description="Largest span of a set, inclusive. A number is seconds, a text has a unit (ns, us, ms, s, min).",
        examples=["20ms"],
    )
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

    def matcher(self) -> ApproximateTime:
        """Return a new policy of the engine."""
        return ApproximateTime(
            n_inputs=len(self.topics),
            queue_size=self.queue_size,
            slop_ns=self.slop,
            age_penalty=self.age_penalty,
            min_periods_ns=tuple(topic.min_period for topic in self.topics),
        )


AnyGroup: TypeAlias = ExactTimeGroup | ApproximateTimeGroup
GROUP_MODELS: tuple[type[AnyGroup], ...] = get_args(AnyGroup)
