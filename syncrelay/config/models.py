"""The keys of groups and topics. The JSON Schema and the errors come from such models and nowhere else."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Annotated, Any, ClassVar, Literal, Self, TypeAlias

from pydantic import BeforeValidator, Discriminator, Field, Tag

from syncrelay.config.bundle import BundleKeys
from syncrelay.config.keys import (
    MOST,
    NOT_NULL,
    Duration,
    FieldPath,
    FrameName,
    Keys,
    OutputPrefix,
    Rate,
    SignedDuration,
    TopicName,
    TransformWait,
    TypeName,
    tag_of_mapping,
)
from syncrelay.config.qos import AUTO, Qos
from syncrelay.config.sections import NodeConfig
from syncrelay.config.wording import describe
from syncrelay.sync import Policy, Ticks


class StampField(Keys):
    """A stamp in a field of its own."""

    field: FieldPath = Field(
        description="Path of a builtin_interfaces/msg/Time in the message, fields joined by dots.",
        examples=["status.stamp"],
    )


StampSource: TypeAlias = Literal["header", "receive"] | StampField


class TransformsConfig(Keys):
    """Which transforms a set waits for."""

    target: FrameName = Field(
        description="The frame to which all messages of a set can be transformed when it leaves.",
        examples=["base_link"],
    )
    wait: TransformWait = Field(
        default=100_000_000,
        description=(
            "How long a set may wait for transforms, once it is matched; then it is dropped as `no_transform`. At most"
            " 10s, as tf2 keeps transforms no longer. A number is seconds, a string has a unit (ns, us, ms, s, min)."
            " Default: 100ms."
        ),
        examples=["250ms"],
        json_schema_extra={"default": "100ms"},
    )


class Topic(Keys):
    """An input, and the output that its messages leave on."""

    topic: TopicName = Field(description="Name of the input topic.", examples=["/camera/image_raw"])
    type: Annotated[TypeName | None, NOT_NULL] = Field(
        default=None,
        description=(
            "Message type in full, package/msg/Name. Default: the one that another group gives this topic; if none"
            " does, that of the topic's publishers, or of the recording."
        ),
        examples=["sensor_msgs/msg/Image"],
    )
    output: Annotated[TopicName | None, NOT_NULL] = Field(
        default=None,
        description="Name of the output topic. Default: the group's output_prefix followed by the input's name.",
        examples=["/fused/image"],
    )
    qos: Qos = Field(
        default=AUTO,
        description=(
            "QoS of input and output: `auto` matches the publishers, a name is one of rclpy's presets, and a mapping"
            " holds rosbag2's override keys, of which those not given stay `auto`. Default: auto."
        ),
        examples=["auto", "sensor_data", {"reliability": "best_effort", "depth": 5}],
        json_schema_extra={"default": "auto"},
    )
    required: Annotated[bool | None, NOT_NULL] = Field(
        default=None,
        description=(
            "Whether every set needs a message of this input. If false, a set leaves without one after the group's"
            " max_wait, with latest_time at once. Default: true; false in a group with a `quorum`."
        ),
    )
    offset: SignedDuration = Field(
        default=0,
        description=(
            "Added to the stamp for matching only, for a sensor whose clock is off: -12ms for one that is 12 ms"
            " ahead. A number is seconds, a string has a unit (ns, us, ms, s, min). Default: 0."
        ),
        examples=["-12ms"],
    )
    stamp: Annotated[
        Annotated[Literal["header", "receive"], Tag("<name>")] | Annotated[StampField, Tag("<mapping>")],
        Discriminator(tag_of_mapping),
    ] = Field(
        default="header",
        description=(
            "Where to read a message's stamp: `header` (the std_msgs/Header that the message begins with), `receive`"
            " (the time of its arrival here) or a field, as in {field: status.stamp}. Default: header."
        ),
        examples=["header", "receive", {"field": "status.stamp"}],
    )
    clock: Literal["host", "device"] = Field(
        default="host",
        description=(
            "Which clock made the stamps. Stamps of a `device` with a clock of its own are mapped to the host's time"
            " before matching. The mapping follows the device's rate, and its clock when that is set or restarts, by"
            " when messages arrive. A stamp that `restamp` gives is in the host's time too. Default: host, no mapping."
        ),
        examples=["device"],
    )
    delay: Duration = Field(
        default=0,
        description=(
            "With `clock: device`, what is known of the least time from a stamp to the message's arrival, such as 8ms"
            " of exposure and transfer: the mapping cannot tell it from the clock, and it is taken off. A number is"
            " seconds, a string has a unit (ns, us, ms, s, min). Default: 0."
        ),
        examples=["8ms"],
    )


class KeyedTopic(Topic):
    """An input of a policy that matches by a field."""

    key: Annotated[FieldPath | None, NOT_NULL] = Field(
        default=None,
        description="Path of the field to match by, if it differs from the group's `key`. Default: the group's.",
        examples=["image_header.frame_id"],
    )


class PacedTopic(Topic):
    """An input of a policy that knows the least time between two messages."""

    min_period: Duration = Field(
        default=0,
        description=(
            "Least time between two messages of this input: it lets a set leave before the next message arrives."
            " Too large a value gives worse sets. A number is seconds, a string has a unit (ns, us, ms, s, min)."
            " Default: 0, nothing known."
        ),
        examples=["9ms"],
    )


class AgedTopic(Topic):
    """An input of a policy that takes the latest message, up to some age."""

    max_age: Annotated[Duration | None, NOT_NULL] = Field(
        default=None,
        description=(
            "How much older than the trigger's message or tick a message of this input may be: longer for one that is"
            " sent rarely, such as a task or a map. A number is seconds, a string has a unit (ns, us, ms, s, min)."
            " Default: the group's."
        ),
        examples=["60min"],
    )


def _restamp(value: Any) -> str:
    """Return a text; which texts are inputs only the group can tell."""
    if not isinstance(value, str):
        raise ValueError(f"expected none, earliest, latest, trigger or an input topic, found {describe(value)}")  # noqa: TRY004
    return value


Topics = Field(
    description="Inputs in the order in which the messages of a set leave, 2 or more.",
    json_schema_extra={"minItems": 2},
)


@dataclass(frozen=True, slots=True)
class Inputs:
    """The absolute names of a group's inputs, and the node in whose namespace the file's names stand."""

    names: tuple[str, ...]
    node: NodeConfig

    @classmethod
    def of(cls, topics: Sequence[Topic], node: NodeConfig) -> Self:
        """Return the names of these topics."""
        return cls(tuple(node.absolute(each.topic) for each in topics), node)

    def index_of(self, topic: str) -> int:
        """Return the index of an input that the file calls by this name. Raises ValueError where it is none."""
        return self.names.index(self.node.absolute(topic))


class Distance(Enum):
    """How it is measured how far apart the messages of a set are."""

    SPAN = "span"
    """From its oldest message to its newest."""

    AGE = "age"
    """How much older than the message, or the tick, that makes the set the oldest of the others is; none is newer."""


@dataclass(frozen=True, slots=True)
class Tolerance:
    """How far apart the stamps of a set may be, in nanoseconds, and the key that says so.

    `wider_policy` is the policy that has this key, where the group's own allows no distance.
    """

    key: str
    ns: int
    wider_policy: str | None = None

    @property
    def is_key(self) -> bool:
        """Whether the group's own policy has the key."""
        return self.wider_policy is None

    @property
    def takes_times_of_arrival(self) -> bool:
        """Whether stamps of a set may differ at all: a time of arrival never equals another stamp."""
        return self.ns != 0


class Group(Keys):
    """Keys that the groups of every policy have, and what the rest of the program asks of a policy."""

    by_stamp: ClassVar[bool] = True
    """Whether stamps are what is matched, as the engine's policy says."""

    repeats: ClassVar[bool] = False
    """Whether a message may be in more than one set, as the engine's policy says."""

    distance: ClassVar[Distance] = Distance.SPAN
    """What `tolerance` bounds: how far apart the messages of a set are is measured like this."""

    waits_for_optional: ClassVar[bool] = True
    """Whether a set that lacks an optional message waits for it, up to `max_wait`."""

    takes_any: ClassVar[bool] = False
    """Whether sets can be made where no input is required, of any so many as `quorum` says."""

    waits_for_next: ClassVar[bool] = False
    """Whether a set waits for the next messages, which may be nearer; a topic's `min_period` can shorten that."""

    patient_policy: ClassVar[str | None] = None
    """The policy that takes the same keys and waits for messages that come too late for this one."""

    trigger_key: ClassVar[str | None] = None
    """The key that names the input, or the rate of the clock, that makes the sets; None where all inputs are alike."""

    matched_by: ClassVar[tuple[str, ...]] = ()
    """Keys that say which messages belong together; none where it is how near their stamps are."""

    policy: str
    queue_size: int = Field(
        default=10,
        ge=1,
        le=MOST,
        description="Messages kept per input while they wait for a match. Default: 10.",
        examples=[10],
    )
    quorum: Annotated[int | None, NOT_NULL] = Field(
        default=None,
        ge=1,
        le=MOST,
        description=(
            "How many inputs a set needs, whichever they are; inputs with `required: true` are always among them. Once"
            " so many are there, a set waits for the others up to `max_wait`. Default: those that are required, which"
            " are all but for `required: false`."
        ),
        examples=[2],
    )
    max_wait: Annotated[Duration | None, NOT_NULL] = Field(
        default=None,
        description=(
            "How long a set with its required messages, or its `quorum`, waits for optional ones or for a closer match;"
            " then it leaves as it is. Needed if an input is optional, except with latest_time, which never waits for"
            " one. If a clock is the trigger, each set leaves this long after its tick. A number is seconds, a string"
            " has a unit (ns, us, ms, s, min). Default: no limit."
        ),
        examples=["100ms"],
    )
    max_rate: Annotated[Rate | None, NOT_NULL] = Field(
        default=None,
        description=(
            "Largest number of sets a second, evenly spaced by their stamps; the others are dropped whole, as"
            " `thinned`. A number is Hz, a string has a unit (Hz, kHz). Default: no limit."
        ),
        examples=["10 Hz"],
    )
    every: int = Field(
        default=1,
        ge=1,
        le=MOST,
        description=(
            "Only every n-th set leaves; the others are dropped whole, as `thinned`. It keeps a share of the sets at"
            " any rate, as topic_tools' drop does of messages; for a rate write `max_rate`. Default: 1, every set."
        ),
        examples=[2],
    )
    restamp: Annotated[str, BeforeValidator(_restamp)] = Field(
        default="none",
        description=(
            "The stamp that all messages of a set leave with: `earliest` or `latest` of the set, that of an input topic"
            " by its name, or with latest_time `trigger`: that of the trigger's message, or the time of the clock's"
            " tick. Default: none, each keeps its own."
        ),
        examples=["none", "earliest", "latest", "trigger", "/lidar/points"],
    )
    transforms: Annotated[TransformsConfig | None, NOT_NULL] = Field(
        default=None,
        description=(
            "Let a set leave only once tf2 can transform each of its messages from the frame_id of its header to this"
            " `target`, at the stamp with which it leaves. Up to `queue_size` sets wait for that. Messages without a"
            " header need no transform. Default: sets leave without."
        ),
        examples=[{"target": "base_link", "wait": "100ms"}],
    )
    lazy: bool = Field(
        default=False,
        description=(
            "Subscribe to the inputs only while somebody subscribes to one of the outputs or to the manifest; messages"
            " that wait when the last subscriber has gone are dropped. Default: false."
        ),
    )
    manifest: bool = Field(
        default=True,
        description=(
            "Publish a small message for each set on ~/GROUP/sets, after the set's own: which messages belong together,"
            " which inputs are missing, span and latency; see docs/reference/manifest.md. Default: true."
        ),
    )
    bundle: Annotated[BundleKeys | None, NOT_NULL] = Field(
        default=None,
        description=(
            "Publish the whole set as one message too, in whose fields the messages of the set stand. Default: none."
        ),
        examples=[{"topic": "/front/set", "type": "realsense2_camera_msgs/msg/RGBD"}],
    )
    outputs: bool = Field(
        default=True,
        description=(
            "Publish each message of a set on an output of its own. If false, sets leave as a `bundle` only."
            " Default: true."
        ),
    )
    output_prefix: Annotated[OutputPrefix | None, NOT_NULL] = Field(
        default=None,
        description=(
            "What default output names begin with. Default: the group's name, absolute as the input's name is, or"
            " relative: of the group front, /camera gives /front/camera, camera gives front/camera, in the node's"
            " namespace, and ~/camera gives ~/front/camera."
        ),
        examples=["/fused"],
    )
    topics: tuple[Topic, ...] = Topics

    @property
    def tolerance(self) -> Tolerance | None:
        """How far apart the stamps of a set may be; None where any distance will do."""
        return None

    @property
    def trigger_topic(self) -> str | None:
        """The input whose every message makes a set; None where all inputs are alike, or a clock makes the sets."""
        trigger = self._trigger
        return trigger if isinstance(trigger, str) else None

    @property
    def ticks(self) -> Ticks | None:
        """The ticks of the clock that makes the sets; None where messages do."""
        trigger = self._trigger
        return trigger if isinstance(trigger, Ticks) else None

    @property
    def _trigger(self) -> object:
        return None if self.trigger_key is None else getattr(self, self.trigger_key)

    def tolerance_of(self, _topic: Topic) -> Tolerance | None:
        """Return how far a topic's stamps may be from those of its set; None where any distance will do."""
        return self.tolerance

    def key_of(self, _topic: Topic) -> str | None:
        """Return the path of the field that a topic's messages are matched by; None where it is their stamps."""
        return None

    def build_policy(self, _inputs: Inputs) -> Policy:
        """Return a new policy of the engine."""
        raise NotImplementedError
