"""What a file may say. The JSON Schema and the errors come from these models and nowhere else."""

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import BeforeValidator, Discriminator, Field, Tag

from syncrelay.config.keys import (
    MOST,
    NOT_NULL,
    Duration,
    FieldPath,
    Keys,
    ListenAddress,
    Namespace,
    NodeName,
    OutputPrefix,
    Rate,
    SignedDuration,
    TopicName,
    TypeName,
    tag_of_mapping,
)
from syncrelay.config.qos import AUTO, Qos
from syncrelay.config.wording import describe

Transport: TypeAlias = Literal["default", "large_messages"]


class NodeConfig(Keys):
    """The ROS node. Remaps and parameters behind --ros-args still win."""

    name: NodeName = Field(
        default="syncrelay", description="Name of the node. Default: syncrelay.", examples=["syncrelay"]
    )
    namespace: Namespace = Field(
        default="",
        description="Namespace of the node, in which relative and `~/` topic names stand. Default: empty, the root.",
        examples=["/robot1"],
    )
    use_sim_time: bool = Field(
        default=False,
        description="Take the time from /clock, as with a simulation or a bag played with --clock. Default: false.",
    )
    transport: Transport = Field(
        default="default",
        description=(
            "How Fast DDS carries messages of this node: `large_messages` gives it shared memory for images and clouds"
            " over 0.5 MB, which publishers and subscribers need too, see configs/large_messages.xml. Transports that"
            " the environment names stand. Default: default."
        ),
        examples=["default", "large_messages"],
    )


class MetricsConfig(Keys):
    """HTTP for programs and people: /status, which `syncrelay top` shows, /metrics, /livez and /readyz."""

    listen: Annotated[ListenAddress | None, NOT_NULL] = Field(
        default=None,
        description=(
            "Where to listen, HOST:PORT; 0.0.0.0 is every interface, port 0 any free one."
            " Default: the first free port of 127.0.0.1:9464 to 9473."
        ),
        examples=["127.0.0.1:9464"],
    )


class DiagnosticsConfig(Keys):
    """What is published about the relay: /diagnostics once a second, with a status for each group."""

    scalars: bool = Field(
        default=False,
        description=(
            "Publish figures of each group as std_msgs/msg/Float64 too, for plotting: ~/GROUP/sets_hz, ~/GROUP/span_ms"
            " and ~/GROUP/latency_ms. Default: false."
        ),
    )


class StampField(Keys):
    """A stamp in a field of its own."""

    field: FieldPath = Field(
        description="Path of a builtin_interfaces/msg/Time in the message, fields joined by dots.",
        examples=["status.stamp"],
    )


StampSource: TypeAlias = Literal["header", "receive"] | StampField


class Topic(Keys):
    """An input, and the output that its messages leave on."""

    topic: TopicName = Field(description="Name of the input topic.", examples=["/camera/image_raw"])
    type: TypeName = Field(description="Message type in full, package/msg/Name.", examples=["sensor_msgs/msg/Image"])
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
    required: bool = Field(
        default=True,
        description=(
            "Whether every set has a message of this input. With false a set leaves without one after the group's"
            " max_wait, with latest_time at once. Default: true."
        ),
    )
    offset: SignedDuration = Field(
        default=0,
        description=(
            "Added to the stamp for matching only, for a sensor whose clock is off: -12ms for one that is 12 ms"
            " ahead. A number is seconds, a text has a unit (ns, us, ms, s, min). Default: 0."
        ),
        examples=["-12ms"],
    )
    stamp: Annotated[
        Annotated[Literal["header", "receive"], Tag("<name>")] | Annotated[StampField, Tag("<mapping>")],
        Discriminator(tag_of_mapping),
    ] = Field(
        default="header",
        description=(
            "Where a message's stamp is: `header` (the std_msgs/Header that the message begins with), `receive` (the"
            " time of its arrival here) or a field, as in {field: status.stamp}. Default: header."
        ),
        examples=["header", "receive", {"field": "status.stamp"}],
    )


class KeyedTopic(Topic):
    """An input of a policy that matches by a field."""

    key: Annotated[FieldPath | None, NOT_NULL] = Field(
        default=None,
        description="Path of the field to match by, where it is another than the group's `key`. Default: the group's.",
        examples=["image_header.frame_id"],
    )


class PacedTopic(Topic):
    """An input of a policy that knows the least time between two messages."""

    min_period: Duration = Field(
        default=0,
        description=(
            "Least time between two messages of this input: with it a set can leave before the next message comes."
            " Too large a value gives worse sets. A number is seconds, a text has a unit (ns, us, ms, s, min)."
            " Default: 0, nothing known."
        ),
        examples=["9ms"],
    )


def _restamp(value: Any) -> str:
    """Return a text; which texts are inputs only the group can tell."""
    if not isinstance(value, str):
        raise ValueError(f"expected none, earliest, latest or an input topic, found {describe(value)}")  # noqa: TRY004
    return value


class Group(Keys):
    """Keys that the groups of every policy have."""

    policy: str
    queue_size: int = Field(
        default=10,
        ge=1,
        le=MOST,
        description="Messages kept per input while they wait for a match. Default: 10.",
        examples=[10],
    )
    max_wait: Annotated[Duration | None, NOT_NULL] = Field(
        default=None,
        description=(
            "How long a set may wait, once its required messages are there, for optional ones or for a closer match;"
            " then it leaves as it is. Needed where an input is optional, but not by latest_time, which never waits for"
            " one. A number is seconds, a text has a unit (ns, us, ms, s, min). Default: no limit."
        ),
        examples=["100ms"],
    )
    max_rate: Annotated[Rate | None, NOT_NULL] = Field(
        default=None,
        description=(
            "Most sets a second, evenly spaced by their stamps; the others are dropped whole, as `thinned`. A number"
            " is Hz, a text has a unit (Hz, kHz). Default: no limit."
        ),
        examples=["10 Hz"],
    )
    every: int = Field(
        default=1,
        ge=1,
        le=MOST,
        description="Only each n-th set leaves; the others are dropped whole, as `thinned`. Default: 1, every set.",
        examples=[2],
    )
    restamp: Annotated[str, BeforeValidator(_restamp)] = Field(
        default="none",
        description=(
            "Stamp of all messages of a set as they leave: `none` (each keeps its own), `earliest` or `latest` of the"
            " set, or the name of an input topic, whose stamp all get. Default: none."
        ),
        examples=["none", "earliest", "latest", "/lidar/points"],
    )
    output_prefix: Annotated[OutputPrefix | None, NOT_NULL] = Field(
        default=None,
        description="What default output names begin with. Default: / and the group's name.",
        examples=["/fused"],
    )
