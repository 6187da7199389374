"""What all models of the file share: no unknown key, no conversion between types, and the kinds of values."""

from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, WithJsonSchema

from syncrelay.config.names import check_topic_name
from syncrelay.config.units import parse_duration
from syncrelay.config.wording import describe


class Keys(BaseModel):
    """A mapping of the file with the keys that its fields name."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


def tag_of_mapping(value: Any) -> str:
    """Tell a union's branch for a mapping from its branch for a single word. Tags in <> never are in the file."""
    return "<name>" if not isinstance(value, dict | Keys) else "<mapping>"


def _not_negative(value: Any) -> int:
    nanoseconds = parse_duration(value)
    if nanoseconds < 0:
        raise ValueError(f"expected a duration of 0 or more, found {describe(value)}")
    return nanoseconds


_UNITS = "(ns|us|µs|μs|ms|s|min)"
_NUMBER = r"([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?"

Duration = Annotated[
    int,
    BeforeValidator(_not_negative),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "number", "minimum": 0},
                {"type": "string", "pattern": rf"^\s*\+?{_NUMBER}\s*{_UNITS}\s*$"},
            ]
        }
    ),
]
"""A duration of 0 or more, in nanoseconds."""

SignedDuration = Annotated[
    int,
    BeforeValidator(parse_duration),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "number"},
                {"type": "string", "pattern": rf"^\s*[+-]?{_NUMBER}\s*{_UNITS}\s*$"},
            ]
        }
    ),
]
"""A duration of either sign, in nanoseconds."""

TopicName = Annotated[str, BeforeValidator(check_topic_name)]
"""A topic name: absolute, relative to the node's namespace, or private (`~/`)."""

__all__ = ["AfterValidator", "Duration", "Keys", "SignedDuration", "TopicName", "tag_of_mapping"]
