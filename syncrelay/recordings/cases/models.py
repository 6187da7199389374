"""What a test file may say. Its JSON Schema and its errors come from these models and nowhere else."""

from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, Self, TypeAlias, TypeVar

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, InstanceOf, WithJsonSchema, model_validator
from pydantic.config import JsonDict

from syncrelay.config.file import Version
from syncrelay.config.keys import NOT_NULL, FieldPath, Keys, Rate, SignedDuration, duration_schema
from syncrelay.config.schema import DRAFT, REF, VARIABLE, Schema, of_mapping
from syncrelay.config.units import parse_duration
from syncrelay.config.wording import describe
from syncrelay.explain import Code
from syncrelay.recordings.cases.bounds import Count, Share, Time
from syncrelay.rig.what_if import Fault, parse_fault, parse_share
from syncrelay.sync import DropReason

MOST_SECONDS: Final = 3600
LONGEST: Final = MOST_SECONDS * 1_000_000_000
LARGEST_SEED: Final = 2**32 - 1


def _fault(value: object) -> Fault:
    if not isinstance(value, str):
        raise ValueError(f"expected a fault such as 'late: /lidar/points 80ms' in quotes, found {describe(value)}")  # noqa: TRY004
    return parse_fault(value)


def _loss(value: object) -> int:
    if not isinstance(value, str):
        raise ValueError(f"expected a share such as 10%, found {describe(value)}")  # noqa: TRY004
    return parse_share(value)


def _short(value: object) -> int:
    duration = parse_duration(value)
    if not 0 <= duration <= LONGEST:
        raise ValueError(f"expected a duration of 0 to {MOST_SECONDS}s, found {describe(value)}")
    return duration


Length = Annotated[
    int, BeforeValidator(_short), WithJsonSchema(duration_schema(sign=r"\+?", minimum=0, maximum=MOST_SECONDS))
]
"""A duration of 0 to an hour, in nanoseconds."""


def _not_zero(duration: int) -> int:
    if not duration:
        raise ValueError("expected a duration above 0: that of a column of the drawing")
    return duration


Period = Annotated[
    int,
    BeforeValidator(_short),
    AfterValidator(_not_zero),
    WithJsonSchema(duration_schema(sign=r"\+?", exclusiveMinimum=0, maximum=MOST_SECONDS)),
]
"""The time of a column: above 0, to an hour, in nanoseconds."""
if TYPE_CHECKING:
    Reason: TypeAlias = str
    CodeName: TypeAlias = str
else:
    Reason = Literal[tuple(reason.value for reason in DropReason)]
    CodeName = Literal[tuple(code.value for code in Code)]


# What is said where nothing is found.
_ALONE: Final = (Code.HEALTHY.value, Code.STARTING.value)


def _one_or_more(codes: tuple[str, ...]) -> tuple[str, ...]:
    if not codes:
        raise ValueError("expected one code or more: `[healthy]` where nothing is wrong")
    alone = next((code for code in codes if code in _ALONE), None)
    if alone is not None and len(set(codes)) > 1:
        raise ValueError(f"`{alone}` stands alone: with another finding a group is not {alone}")
    return codes


Codes = Annotated[tuple[CodeName, ...], AfterValidator(_one_or_more), Field(json_schema_extra={"minItems": 1})]
"""Codes of findings."""

WhatIf = Annotated[
    InstanceOf[Fault],
    BeforeValidator(_fault),
    WithJsonSchema({"type": "string", "pattern": "^(late|drop|offset|drift|dead): *[/~A-Za-z]"}),
]
"""A fault, as `--what-if` takes it."""

Loss = Annotated[
    int, BeforeValidator(_loss), WithJsonSchema({"type": "string", "pattern": r"^[0-9]{1,3}(\.[0-9]{1,4})?\s*%$"})
]
"""A share of messages in millionths."""

_T = TypeVar("_T")


def _not_empty(mapping: dict[str, _T]) -> dict[str, _T]:
    if not mapping:
        raise ValueError("expects nothing: name what you expect, or leave this out")
    return mapping


_NOT_EMPTY: Final[JsonDict] = {"minProperties": 1}
_DURATION: Final = "A number is seconds, a string has a unit (ns, us, ms, s, min)."


def _time(meaning: str, example: str) -> Any:
    return Field(default=0, description=f"{meaning} {_DURATION} Default: 0.", examples=[example])


def _unset(description: str, *examples: object) -> Any:
    """Return a field that is None where the file does not have it."""
    return Field(default=None, description=description, examples=[*examples] or None)


OptionalCount = Annotated[Count | None, NOT_NULL]
OptionalShare = Annotated[Share | None, NOT_NULL]
OptionalTime = Annotated[Time | None, NOT_NULL]


class InputSource(Keys):
    """What comes of an input: as it was drawn, or so many a second."""

    rate: Annotated[Rate | None, NOT_NULL] = _unset(
        "Messages a second, for an input that is not drawn. A number is Hz, a string has a unit (Hz, kHz). Default:"
        " none, it is drawn or sends nothing.",
        "30 Hz",
    )
    phase: Length = _time("When the first is measured, with `rate`.", "3ms")
    jitter: Length = _time("Standard deviation of stamps, with `rate`.", "1ms")
    latency: Length = _time("From the measurement to the receipt.", "20ms")
    latency_jitter: Length = _time("Standard deviation of the latency, with `rate`.", "4ms")
    offset: SignedDuration = _time("How far ahead the clock is that stamps.", "12ms")
    drop: Loss = Field(
        default=0, description="Share of messages that are never sent, with `rate`. Default: 0%.", examples=["3%"]
    )
    field: Annotated[FieldPath | None, NOT_NULL] = _unset(
        "Which field the keys of the drawing stand in, for `equal_key`; a message has no other. Default: the one that"
        " the file matches by.",
        "header.frame_id",
    )


class InputExpectation(Keys):
    """What becomes of the messages of an input."""

    model_config = ConfigDict(json_schema_extra=_NOT_EMPTY)

    received: OptionalCount = _unset("Messages that come. Default: any number.", 300)
    in_sets: OptionalCount = _unset("Messages that leave in sets. Default: any number.", ">= 290")
    match_rate: OptionalShare = _unset("Share of its messages that leave in sets. Default: any.", ">= 0.98")
    dropped: OptionalCount = _unset("Messages that leave without a set. Default: any number.", 0)
    drops: Annotated[dict[Reason, Count], AfterValidator(_not_empty)] = Field(
        default_factory=dict,
        description="Messages that leave without a set, by reason. Default: any number of any.",
        examples=[{"overflow": 0}],
        json_schema_extra=_NOT_EMPTY,
    )

    @model_validator(mode="after")
    def _expects_something(self) -> Self:
        if not self.model_fields_set:
            raise ValueError("expects nothing: name a figure such as `received`, or leave this out")
        return self


class Expectation(InputExpectation):
    """What a group makes of the messages."""

    received: OptionalCount = _unset("Messages that come, of all inputs. Default: any number.", 1200)
    in_sets: OptionalCount = _unset("Messages that leave in sets, of all inputs. Default: any.", ">= 580")
    match_rate: OptionalShare = _unset(
        "Share of the messages of the rarest required input, or of the trigger, that leave in sets. Default: any.",
        ">= 0.98",
    )
    sets: OptionalCount = _unset("Sets that leave. Default: any number.", ">= 980")
    span_p95: OptionalTime = _unset(f"Span that 95 % of the sets do not exceed. {_DURATION} Default: any.", "< 20ms")
    span_max: OptionalTime = _unset(f"Span of the widest set. {_DURATION} Default: any.", "<= 20ms")
    latency_p95: OptionalTime = _unset(
        "How long 95 % of the sets at most waited, from the receipt of their newest message until they left."
        f" {_DURATION} Default: any.",
        "< 60ms",
    )
    latency_max: OptionalTime = _unset(f"The longest such wait. {_DURATION} Default: any.", "<= 100ms")
    findings: Annotated[Codes | None, NOT_NULL] = _unset(
        "What the relay would find for 3 s or longer, by code: exactly these. `healthy` alone is none. Default: any.",
        ["healthy"],
    )
    inputs: Annotated[dict[str, InputExpectation], AfterValidator(_not_empty)] = Field(
        default_factory=dict,
        description="The same of single inputs, by their topics. Default: any.",
        json_schema_extra=_NOT_EMPTY,
    )


class Case(Keys):
    """Messages that come, drawn, simulated or recorded, and what a group shall make of them."""

    group: Annotated[str | None, NOT_NULL] = _unset(
        "The group that is tested. Default: the only one of the file.", "front"
    )
    drawing: Annotated[str | None, NOT_NULL] = _unset(
        "Lanes of messages, one a line, a column a `period`: `lidar |a.bc`; and what leaves because of which message:"
        " `-> b: aA`. Default: nothing is drawn.",
        "lidar  |a...b\ncamera |.A...\n-> b: aA\n",
    )
    period: Period = Field(
        default=10_000_000, description=f"Time from column to column. {_DURATION} Default: 10ms.", examples=["10ms"]
    )
    recording: Annotated[str | None, NOT_NULL] = _unset(
        "A recording, its path relative to this file. Default: none, messages are drawn or simulated.", "rig.mcap"
    )
    inputs: dict[str, InputSource] = Field(
        default_factory=dict,
        description="What comes of each input, by its topic, in numbers. Default: what is drawn, as it is drawn.",
    )
    lasts: Annotated[Length | None, NOT_NULL] = _unset(
        f"How long inputs with a `rate` send, at most 3600s. {_DURATION} Default: none, it is needed for them.", "30s"
    )
    what_if: tuple[WhatIf, ...] = Field(
        default=(),
        description="Faults laid over the messages, as `syncrelay replay --what-if` takes them. Default: none.",
        examples=[["late: /lidar/points 80ms"]],
    )
    seed: Annotated[int, Field(ge=0, le=LARGEST_SEED)] = Field(
        default=0, description="Seed of jitter, losses and faults. Default: 0."
    )
    expect: Annotated[Expectation | None, NOT_NULL] = _unset("What the group makes of it. Default: what is drawn.")


class CasesFile(Keys):
    """Tests of a syncrelay file: cases of messages that come, and what its groups shall make of them."""

    version: Version = Field(description="Version of this format: 1.")
    config: str = Field(
        description="The syncrelay file that is tested, its path relative to this one.", examples=["fusion.yaml"]
    )
    cases: dict[str, Case] = Field(
        description="Cases by name, 1 or more: a name is a sentence that says what shall be so.",
        json_schema_extra={"minProperties": 1},
    )


SCHEMA_ID: Final = "urn:syncrelay:schema:test:1"
"""The name of the JSON Schema; it ends in the `version` of the files that it describes."""


def cases_schema() -> Schema:
    """Return the JSON Schema of a test file (draft 7, which editors read)."""
    generated: dict[str, Any] = CasesFile.model_json_schema(ref_template=REF + "{model}")
    models: dict[str, Schema] = generated.pop("$defs")
    return {
        "$schema": DRAFT,
        "$id": SCHEMA_ID,
        "title": "syncrelay test file",
        **of_mapping(generated),
        "definitions": {**{name: of_mapping(model) for name, model in models.items()}, "Variable": VARIABLE},
    }
