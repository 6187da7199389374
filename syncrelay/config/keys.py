"""What all models of the file share: no unknown key, no conversion between types, and the kinds of values."""

from typing import Annotated, Any, Final

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    PlainValidator,
    WithJsonSchema,
    model_validator,
)

from syncrelay.config.document import EXTENSION
from syncrelay.config.listen import check_listen, parse_host
from syncrelay.config.names import (
    LONGEST_TOPIC,
    check_field_path,
    check_frame,
    check_namespace,
    check_node_name,
    check_output_prefix,
    check_topic_name,
    check_type_name,
)
from syncrelay.config.units import parse_clock_rate, parse_duration, parse_rate
from syncrelay.config.wording import describe
from syncrelay.sync import Ticks


class Keys(BaseModel):
    """A mapping of the file with the keys that its fields name, and any that begin with EXTENSION."""

    # Validators are built on first use: the file's builds those below it, and the lenient ones are rarely needed.
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, defer_build=True)

    @model_validator(mode="before")
    @classmethod
    def _without_extensions(cls, keys: Any) -> Any:
        if isinstance(keys, dict) and any(key.startswith(EXTENSION) for key in keys):
            return {key: value for key, value in keys.items() if not key.startswith(EXTENSION)}
        return keys


def tag_of_mapping(value: Any) -> str:
    """Return the tag of a union's branch: `<mapping>` for a mapping, `<name>` for a word."""
    return "<mapping>" if isinstance(value, dict | Keys) else "<name>"


def not_negative(value: Any) -> int:
    """Return the nanoseconds of a duration of 0 or more; raises ValueError saying what to write instead."""
    nanoseconds = parse_duration(value)
    if nanoseconds < 0:
        raise ValueError(f"expected a duration of 0 or more, found {describe(value)}")
    return nanoseconds


def _refuse_null(value: Any) -> Any:
    if value is None:
        raise ValueError("no value: give the key a value, or remove it")
    return value


MOST: Final = 1_000_000
"""The largest number of messages or sets that a key may name. DDS counts in 32 bits and refuses more at run time."""

NOT_NULL: Final = BeforeValidator(_refuse_null)
"""For a field that is None if its key is absent: refuses `key:` without a value."""

ListenAddress = Annotated[str, AfterValidator(check_listen)]
Host = Annotated[str, AfterValidator(parse_host)]
"""A host name or an address without a port, as parse_host returns it."""

_NUMBER: Final = r"([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?"
_UNIT: Final = "(ns|us|µs|μs|ms|s|min)"
_TOKENS: Final = "[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*"


def duration_schema(*, sign: str, **limits: float) -> dict[str, Any]:
    """Return the JSON Schema of a duration with a pattern for the sign that it may have."""
    return {
        "anyOf": [
            {"type": "number", **limits},
            {"type": "string", "pattern": rf"^\s*{sign}{_NUMBER}\s*{_UNIT}\s*$"},
        ]
    }


def _text(pattern: str, **limits: int) -> WithJsonSchema:
    return WithJsonSchema({"type": "string", "pattern": pattern, **limits})


Duration = Annotated[int, BeforeValidator(not_negative), WithJsonSchema(duration_schema(sign=r"\+?", minimum=0))]
"""A duration of 0 or more, in nanoseconds."""

NONE: Final = "none"
"""What stands in the file for a limit that is not there."""


def _or_none(value: Any) -> int | None:
    return None if value == NONE else not_negative(value)


DurationOrNone = Annotated[
    int | None,
    PlainValidator(_or_none),
    WithJsonSchema({"anyOf": [*duration_schema(sign=r"\+?", minimum=0)["anyOf"], {"const": NONE}]}),
]
"""A duration of 0 or more, in nanoseconds; None for `none`."""


_TF2_KEEPS_NS: Final = 10_000_000_000


def _while_tf2_keeps_it(value: object) -> int:
    duration = not_negative(value)
    if duration > _TF2_KEEPS_NS:
        raise ValueError("at most 10s: tf2 keeps transforms no longer")
    return duration


TransformWait = Annotated[
    int,
    BeforeValidator(_while_tf2_keeps_it),
    WithJsonSchema(duration_schema(sign=r"\+?", minimum=0, maximum=10)),
]
"""A duration of 0 to 10 s, in nanoseconds."""

SignedDuration = Annotated[int, BeforeValidator(parse_duration), WithJsonSchema(duration_schema(sign="[+-]?"))]
"""A duration of either sign, in nanoseconds."""

_RATE_TEXT: Final = {"type": "string", "pattern": rf"^\s*\+?{_NUMBER}\s*([Hh]z|kHz)\s*$"}

Rate = Annotated[
    int,
    BeforeValidator(parse_rate),
    WithJsonSchema({"anyOf": [{"type": "number", "exclusiveMinimum": 0}, _RATE_TEXT]}),
]
"""A rate, as the nanoseconds between two events."""

_TOPIC_NAME: Final = {"type": "string", "pattern": rf"^(~?/)?{_TOKENS}$", "maxLength": LONGEST_TOPIC}

TopicName = Annotated[str, BeforeValidator(check_topic_name), WithJsonSchema(_TOPIC_NAME)]
"""A topic name: absolute, relative to the node's namespace, or private (`~/`)."""


def _trigger(value: object) -> str | Ticks:
    """Tell a rate from a topic, whose name begins with no digit."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"expected an input topic or a rate such as 30 Hz, found {describe(value)}")  # noqa: TRY004
    if isinstance(value, str) and not value.lstrip().startswith((*"+-.0123456789",)):
        return check_topic_name(value)
    rate = parse_clock_rate(value)
    return Ticks(rate.numerator, rate.denominator)


Trigger = Annotated[
    str | Ticks,
    PlainValidator(_trigger),
    WithJsonSchema(
        {"anyOf": [{"type": "number", "minimum": 0.001, "maximum": 10_000}, _RATE_TEXT, _TOPIC_NAME]},
    ),
]
"""What makes sets: the messages of a topic, or a clock at a rate."""

OutputPrefix = Annotated[str, AfterValidator(check_output_prefix), _text(rf"^(/|~|(~?/)?{_TOKENS})?$")]
"""The prefix of default output names."""

NodeName = Annotated[str, AfterValidator(check_node_name), _text("^[A-Za-z_][A-Za-z0-9_]*$", maxLength=255)]
"""A node's name without its namespace."""

Namespace = Annotated[str, AfterValidator(check_namespace), _text(rf"^(/|/?{_TOKENS})?$")]
"""A node's namespace; empty or `/` is the root."""

TypeName = Annotated[str, BeforeValidator(check_type_name), _text("^[A-Za-z][A-Za-z0-9_]*/msg/[A-Za-z][A-Za-z0-9_]*$")]
"""A message type in full, `package/msg/Name`."""

FrameName = Annotated[str, AfterValidator(check_frame), _text("^[^/]")]
"""A coordinate frame, as tf2 looks it up."""

FieldPath = Annotated[str, AfterValidator(check_field_path), _text(r"^[A-Za-z]\w*(\.[A-Za-z]\w*)*$")]
"""Fields of a message joined by dots."""
