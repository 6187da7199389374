"""The policies of syncrelay: a model of the keys of each, which makes the engine's policy and says what is special.

To add a policy, see docs/architecture.md.
"""

from typing import Annotated, Final, Literal

from pydantic import Field

from syncrelay.config.keys import NOT_NULL, Duration, DurationOrNone, FieldPath, Trigger
from syncrelay.config.models import (
    AgedTopic,
    Distance,
    Group,
    Inputs,
    KeyedTopic,
    PacedTopic,
    Tolerance,
    Topic,
    Topics,
)
from syncrelay.sync import (
    ApproximateEpsilonTime,
    ApproximateTime,
    ApproximateTimeEager,
    EqualKey,
    ExactTime,
    LatestAtTicks,
    LatestTime,
    Ticks,
)

Slop = Field(
    description=(
        "Largest span of a set, inclusive; or `none`: then the nearest messages are a set, however far apart, as in C++"
        " ApproximateTime without a maximum interval. A number is seconds, a string has a unit (ns, us, ms, s, min)."
    ),
    examples=["20ms", "none"],
)


class NearTopic(Topic):
    """An input of a policy that can allow for how far each input's stamps may be off."""

    tolerance: Annotated[Duration | None, NOT_NULL] = Field(
        default=None,
        description=(
            "How far stamps of this input may be off, if by less than half the group's `slop`: two messages of a set"
            " are no farther apart than both may be off together. `slop` is needed too: it stays the largest span of a"
            " set. A number is seconds, a string has a unit (ns, us, ms, s, min). Default: half the slop."
        ),
        examples=["5ms"],
    )


class PacedNearTopic(PacedTopic, NearTopic):
    """An input of a policy that waits for better messages."""


class SlopGroup(Group):
    """A group whose sets may be as wide as `slop`."""

    slop: DurationOrNone = Slop

    @property
    def tolerance(self) -> Tolerance | None:
        """The largest span of a set; None where it may be any."""
        return None if self.slop is None else Tolerance("slop", self.slop)

    def tolerance_of(self, topic: Topic) -> Tolerance | None:
        """Return the topic's own `tolerance`, else the group's slop."""
        own = topic.tolerance if isinstance(topic, NearTopic) else None
        return self.tolerance if own is None else Tolerance("tolerance", own)

    def tolerances_ns(self) -> tuple[int | None, ...]:
        """Return the `tolerance` of each topic, in nanoseconds; None where it has none."""
        return tuple(topic.tolerance if isinstance(topic, NearTopic) else None for topic in self.topics)


class ExactTimeGroup(Group):
    """Sets of equal stamps."""

    takes_any = True

    policy: Literal["exact_time"] = Field(description="Sets of equal stamps.")
    topics: tuple[Topic, ...] = Topics

    @property
    def tolerance(self) -> Tolerance:
        """None at all, whatever the keys."""
        return Tolerance("slop", 0, wider_policy="approximate_time")

    def build_policy(self, _inputs: Inputs) -> ExactTime:
        """Return a new policy of the engine."""
        return ExactTime(n_inputs=len(self.topics), queue_size=self.queue_size)


class ApproximateTimeGroup(SlopGroup):
    """Sets of near stamps, each the best that there is."""

    takes_any = True
    waits_for_next = True

    policy: Literal["approximate_time"] = Field(
        description="Sets of near stamps, each the best that there is; waits until no better one can come."
    )
    age_penalty: float = Field(
        default=0.1,
        ge=0,
        allow_inf_nan=False,
        description=(
            "A later set replaces an earlier one only if its span is smaller by this fraction of the delay: with 0.1, a"
            " set 50 ms later must be at least 5 ms tighter. 0 takes the smallest span, 1 mostly the first set."
            " Default: 0.1."
        ),
        examples=[0.1],
    )
    topics: tuple[PacedNearTopic, ...] = Topics

    def build_policy(self, _inputs: Inputs) -> ApproximateTime:
        """Return a new policy of the engine."""
        return ApproximateTime(
            n_inputs=len(self.topics),
            queue_size=self.queue_size,
            slop_ns=self.slop,
            age_penalty=self.age_penalty,
            min_periods_ns=tuple(topic.min_period for topic in self.topics),
            tolerances_ns=self.tolerances_ns(),
        )


class ApproximateTimeEagerGroup(SlopGroup):
    """Sets of near stamps, each as soon as there is one."""

    patient_policy = "approximate_time"

    policy: Literal["approximate_time_eager"] = Field(
        description="Sets of near stamps: the tightest that holds the message just arrived, at once."
    )
    topics: tuple[NearTopic, ...] = Topics

    def build_policy(self, _inputs: Inputs) -> ApproximateTimeEager:
        """Return a new policy of the engine."""
        return ApproximateTimeEager(
            n_inputs=len(self.topics),
            queue_size=self.queue_size,
            slop_ns=self.slop,
            tolerances_ns=self.tolerances_ns(),
        )


class ApproximateEpsilonTimeGroup(SlopGroup):
    """Sets of the oldest messages of all inputs, where these are near."""

    policy: Literal["approximate_epsilon_time"] = Field(
        description=(
            "Sets of the oldest messages of all inputs, where these lie within slop; no search for better ones. For the"
            " same sets as nodes on ApproximateEpsilonTime, such as stereo_image_proc with a tolerance."
        )
    )
    topics: tuple[NearTopic, ...] = Topics

    def build_policy(self, _inputs: Inputs) -> ApproximateEpsilonTime:
        """Return a new policy of the engine."""
        return ApproximateEpsilonTime(
            n_inputs=len(self.topics),
            queue_size=self.queue_size,
            epsilon_ns=self.slop,
            tolerances_ns=self.tolerances_ns(),
        )


class LatestTimeGroup(Group):
    """At each message of one input, or at each tick of a clock, the latest of every other."""

    repeats = LatestTime.repeats
    distance = Distance.AGE
    waits_for_optional = False
    takes_any = True
    trigger_key = "trigger"
    matched_by = ("trigger", "max_age")

    policy: Literal["latest_time"] = Field(
        description="At each message of the trigger, or each tick of a clock, the latest not newer one of every input."
    )
    trigger: Trigger = Field(
        description=(
            "Either an input topic (each of its messages makes a set) or a rate such as 30 Hz (each clock tick makes a"
            " set, which leaves `max_wait` later with what has come by then). A number is Hz, a string has a unit (Hz,"
            " kHz)."
        ),
        examples=["/camera/image_raw", "30 Hz"],
    )
    max_age: Annotated[Duration | None, NOT_NULL] = Field(
        default=None,
        description=(
            "How much older than the trigger's message or tick another may be, where its input has no `max_age` of its"
            " own. A number is seconds, a string has a unit (ns, us, ms, s, min). Default: no limit."
        ),
        examples=["500ms"],
    )
    topics: tuple[AgedTopic, ...] = Topics

    @property
    def tolerance(self) -> Tolerance | None:
        """How much older than the trigger's message or tick another may be."""
        return None if self.max_age is None else Tolerance("max_age", self.max_age)

    def tolerance_of(self, topic: Topic) -> Tolerance | None:
        """Return the topic's own `max_age`, else the group's."""
        own = topic.max_age if isinstance(topic, AgedTopic) else None
        return self.tolerance if own is None else Tolerance("max_age", own)

    def build_policy(self, inputs: Inputs) -> LatestTime | LatestAtTicks:
        """Return a new policy of the engine."""
        n_inputs = len(self.topics)
        tolerances = [self.tolerance_of(topic) for topic in self.topics]
        max_ages_ns = [None if tolerance is None else tolerance.ns for tolerance in tolerances]
        if isinstance(self.trigger, Ticks):
            return LatestAtTicks(
                n_inputs=n_inputs, queue_size=self.queue_size, ticks=self.trigger, max_ages_ns=max_ages_ns
            )
        return LatestTime(
            n_inputs=n_inputs,
            queue_size=self.queue_size,
            trigger=inputs.index_of(self.trigger),
            max_ages_ns=max_ages_ns,
        )


class EqualKeyGroup(Group):
    """Sets of equal values of a field."""

    by_stamp = EqualKey.by_stamp
    matched_by = ("key",)

    policy: Literal["equal_key"] = Field(
        description="Sets of equal values of a field, such as a sequence number, an id or a frame name."
    )
    key: Annotated[FieldPath | None, NOT_NULL] = Field(
        default=None,
        description="Path of the field to match by, fields joined by dots: a number, a string or a time. Default: none,"
        " every topic has a `key` of its own.",
        examples=["header.frame_id"],
    )
    topics: tuple[KeyedTopic, ...] = Topics

    def key_of(self, topic: Topic) -> str | None:
        """Return the topic's own key, else the group's."""
        return (topic.key if isinstance(topic, KeyedTopic) else None) or self.key

    def build_policy(self, _inputs: Inputs) -> EqualKey:
        """Return a new policy of the engine."""
        return EqualKey(n_inputs=len(self.topics), queue_size=self.queue_size)


GROUP_MODELS: Final[tuple[type[Group], ...]] = (
    ExactTimeGroup,
    ApproximateTimeGroup,
    ApproximateTimeEagerGroup,
    ApproximateEpsilonTimeGroup,
    LatestTimeGroup,
    EqualKeyGroup,
)
"""In the order in which people read of them. Those of other packages come through `installed.py`."""
