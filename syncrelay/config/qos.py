"""QoS of a topic: a preset, or single policies with the rest matched to the publishers."""

from dataclasses import dataclass
from typing import Annotated, Any, Final, Literal, TypeAlias

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Discriminator,
    Field,
    GetPydanticSchema,
    Tag,
    WithJsonSchema,
)

from syncrelay.config.keys import Keys, tag_of_mapping
from syncrelay.config.units import MAX_NS, parse_duration
from syncrelay.config.wording import describe

PresetName: TypeAlias = Literal[
    "system_default",
    "default",
    "sensor_data",
    "services_default",
    "parameters",
    "parameter_events",
    "action_status_default",
    "best_available",
]
"""Names that rclpy.qos.QoSPresetProfiles.get_from_short_key takes."""

_NS_PER_SECOND: Final = 1_000_000_000


@dataclass(frozen=True, slots=True)
class QosPreset:
    """One of rclpy's profiles, whatever the publishers offer."""

    name: PresetName


def _qos_duration(value: Any) -> int:
    """Read our durations, and the {sec, nsec} of rosbag2's override files."""
    if not isinstance(value, dict):
        nanoseconds = parse_duration(value)
    elif value.keys() == {"sec", "nsec"} and all(type(part) is int for part in value.values()):
        nanoseconds = min(value["sec"] * _NS_PER_SECOND + value["nsec"], MAX_NS)
    else:
        raise ValueError("expected a duration such as 100ms, or both sec and nsec as whole numbers")
    if nanoseconds < 0:
        raise ValueError(f"expected a duration of 0 or more, found {describe(value)}")
    return nanoseconds


_QosDuration = Annotated[
    int,
    BeforeValidator(_qos_duration),
    WithJsonSchema({"anyOf": [{"type": "number", "minimum": 0}, {"type": "string"}, {"type": "object"}]}),
]


class QosOverrides(Keys):
    """Single QoS policies by rosbag2's override keys; what is None is matched to the publishers (`auto`)."""

    history: Literal["keep_last", "keep_all", "system_default"] | None = None
    depth: int | None = Field(default=None, ge=0)
    reliability: Literal["reliable", "best_effort", "system_default", "best_available"] | None = None
    durability: Literal["volatile", "transient_local", "system_default", "best_available"] | None = None
    deadline: _QosDuration | None = None
    lifespan: _QosDuration | None = None
    liveliness: Literal["automatic", "manual_by_topic", "system_default", "best_available"] | None = None
    liveliness_lease_duration: _QosDuration | None = None
    avoid_ros_namespace_conventions: bool | None = None


AUTO: Final = QosOverrides()
"""Every policy matched to the publishers."""


def _named(name: Any) -> QosPreset | QosOverrides:
    return AUTO if name == "auto" else QosPreset(name)


_QosInFile: Any = Annotated[
    Annotated[Literal["auto", PresetName], AfterValidator(_named), Tag("<name>")]
    | Annotated[QosOverrides, Tag("<mapping>")],
    Discriminator(tag_of_mapping),
]
Qos: TypeAlias = Annotated[
    QosPreset | QosOverrides, GetPydanticSchema(lambda _, handler: handler.generate_schema(_QosInFile))
]
"""`auto`, the name of a preset or a mapping of overrides in the file; a profile or overrides in Python."""
