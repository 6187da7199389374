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
    ValidationInfo,
    WithJsonSchema,
    field_validator,
)

from syncrelay.config.keys import MOST, NOT_NULL, Keys, duration_schema, not_negative, tag_of_mapping
from syncrelay.config.units import MAX_NS

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
        return not_negative(value)
    if value.keys() == {"sec", "nsec"} and all(type(part) is int and part >= 0 for part in value.values()):
        # rosbag2 writes "no limit" as more seconds than nanoseconds can count.
        return int(min(value["sec"] * _NS_PER_SECOND + value["nsec"], MAX_NS))
    raise ValueError("expected a duration such as 100ms, or a mapping of sec and nsec with whole numbers of 0 or more")


_SEC_AND_NSEC: Final = {
    "type": "object",
    "properties": {
        "sec": {"type": "integer", "minimum": 0, "description": "Seconds."},
        "nsec": {"type": "integer", "minimum": 0, "description": "Nanoseconds."},
    },
    "required": ["sec", "nsec"],
    "additionalProperties": False,
}
_QosDuration = Annotated[
    int | None,
    BeforeValidator(_qos_duration),
    WithJsonSchema({"anyOf": [*duration_schema(sign=r"\+?", minimum=0)["anyOf"], _SEC_AND_NSEC]}),
]
_DURATION: Final = "A number is seconds, a string has a unit (ns, us, ms, s, min), a mapping has sec and nsec."


class QosOverrides(Keys):
    """Single QoS policies by rosbag2's override keys; what is None is matched to the publishers (`auto`)."""

    history: Annotated[Literal["keep_last", "keep_all", "system_default"] | None, NOT_NULL] = Field(
        default=None, description="Which messages DDS keeps until they are taken. Default: keep_last."
    )
    depth: Annotated[int | None, NOT_NULL] = Field(
        default=None,
        ge=0,
        le=MOST,
        description="Messages that DDS keeps per topic until they are taken; not queue_size. Default: 100.",
        examples=[5],
    )
    reliability: Annotated[Literal["reliable", "best_effort", "system_default", "best_available"] | None, NOT_NULL] = (
        Field(
            default=None, description="Whether lost messages are sent again. Default: reliable if all publishers are."
        )
    )
    durability: Annotated[
        Literal["volatile", "transient_local", "system_default", "best_available"] | None, NOT_NULL
    ] = Field(
        default=None,
        description="Whether late subscribers get earlier messages. Default: transient_local if all publishers are.",
    )
    deadline: _QosDuration = Field(
        default=None, description=f"Longest time between two messages. {_DURATION} Default: no limit."
    )
    lifespan: _QosDuration = Field(
        default=None, description=f"Age at which a message expires. {_DURATION} Default: no limit."
    )
    liveliness: Annotated[
        Literal["automatic", "manual_by_topic", "system_default", "best_available"] | None, NOT_NULL
    ] = Field(default=None, description="How a publisher shows that it is alive. Default: system_default.")
    liveliness_lease_duration: _QosDuration = Field(
        default=None, description=f"Silence after which a publisher counts as lost. {_DURATION} Default: no limit."
    )

    @field_validator("depth")
    @classmethod
    def _is_kept(cls, depth: int | None, info: ValidationInfo) -> int | None:
        if depth == 0 and info.data.get("history") in (None, "keep_last"):
            raise ValueError("a depth of 0 keeps no message, expected 1 or more")
        return depth


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
