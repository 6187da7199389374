"""The section `export`: how `syncrelay export` makes a dataset of the sets. The relay ignores it."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Final, Literal

from pydantic import AfterValidator, Discriminator, Field, Tag, WithJsonSchema

from syncrelay.config.keys import NOT_NULL, Duration, FieldPath, Keys, TopicName, tag_of_mapping
from syncrelay.config.names import check_field_path, check_topic_name
from syncrelay.config.sections import NodeConfig
from syncrelay.config.wording import describe

ACTION: Final = "action"
"""The feature that every LeRobot dataset has: what the robot was told to do."""

_LONGEST_NAME: Final = 200
_FEATURE: Final = r"action|observation(\.[A-Za-z0-9_]+)+"
_TOKEN: Final = r"[A-Za-z_][A-Za-z0-9_]*"  # noqa: S105  a name's
_NUMBERS: Final = rf"(~?/)?{_TOKEN}(/{_TOKEN})*:[A-Za-z]\w*(\.[A-Za-z]\w*)*"
_SOURCE: Final = rf"(~?/)?{_TOKEN}(/{_TOKEN})*(:[A-Za-z]\w*(\.[A-Za-z]\w*)*)?"
_MOST_FPS: Final = 1000
# The default of max_gap, in frames.
_FRAMES_OF_A_GAP: Final = 5


def _feature_name(name: str) -> str:
    if re.fullmatch(_FEATURE, name) is None:
        raise ValueError(
            f"expected `action` or a name that begins with `observation.`, such as observation.state,"
            f" found {describe(name)}"
        )
    if len(name) > _LONGEST_NAME:
        raise ValueError(f"it has {len(name)} characters, at most {_LONGEST_NAME} are allowed: it becomes a folder")
    return name


def _source(text: str) -> str:
    topic, colon, path = text.partition(":")
    check_topic_name(topic)
    if colon:
        check_field_path(path)
    return text


def _numbers(text: str) -> str:
    if ":" not in text:
        raise ValueError(
            f"expected TOPIC:FIELD, such as /joint_states:position, found {describe(text)}: a list becomes one vector"
            " of numbers"
        )
    return _source(text)


def _not_empty(sources: tuple[str, ...]) -> tuple[str, ...]:
    if not sources:
        raise ValueError("expected one TOPIC:FIELD or more, found none")
    return sources


def _task(text: str) -> str:
    if not text.strip():
        raise ValueError("expected what the robot does, such as `pick up the cube`, found no words")
    return text


def _tag_of_list(value: Any) -> str:
    return "<list>" if isinstance(value, list | tuple) else "<name>"


FeatureName = Annotated[str, AfterValidator(_feature_name)]
"""What LeRobot calls a column: `action`, or a name below `observation`."""

Words = Annotated[str, AfterValidator(_task), WithJsonSchema({"type": "string", "pattern": r"\S"})]
"""What the robot does, in words."""

OneSource = Annotated[str, AfterValidator(_source), WithJsonSchema({"type": "string", "pattern": f"^{_SOURCE}$"})]
"""TOPIC for its images, TOPIC:FIELD for numbers."""

NumberSource = Annotated[str, AfterValidator(_numbers), WithJsonSchema({"type": "string", "pattern": f"^{_NUMBERS}$"})]
"""TOPIC:FIELD, numbers of a message."""

FeatureSources = Annotated[
    Annotated[OneSource, Tag("<name>")]
    | Annotated[
        tuple[NumberSource, ...], AfterValidator(_not_empty), Field(json_schema_extra={"minItems": 1}), Tag("<list>")
    ],
    Discriminator(_tag_of_list),
]


class TaskTopic(Keys):
    """A topic that says what the robot does."""

    topic: TopicName = Field(description="An input of the group.", examples=["/task"])
    field: FieldPath = Field(description="Path of a string in its messages, fields joined by dots.", examples=["data"])


class LerobotKeys(Keys):
    """How sets become frames of a LeRobotDataset; see docs/howto/lerobot.md."""

    group: Annotated[str | None, NOT_NULL] = Field(
        default=None, description="The group whose sets are written. Default: the only group.", examples=["front"]
    )
    fps: int = Field(
        ge=1,
        le=_MOST_FPS,
        description="Frames a second. Each frame is the set that is nearest to its time; nothing is interpolated.",
        examples=[10],
    )
    task: Annotated[
        Annotated[Words, Tag("<name>")] | Annotated[TaskTopic, Tag("<mapping>")], Discriminator(tag_of_mapping)
    ] = Field(
        description="What the robot does, in words; or where a topic says so, as in {topic: /task, field: data}.",
        examples=["pick up the cube", {"topic": "/task", "field": "data"}],
    )
    max_gap: Annotated[Duration | None, NOT_NULL] = Field(
        default=None,
        description=(
            "Longest time from one set to the next; a recording with a longer gap is refused. A number is seconds, a"
            " string has a unit (ns, us, ms, s, min). Default: five frames."
        ),
        examples=["500ms"],
    )
    incomplete: Literal["leave_out", "keep"] = Field(
        default="leave_out",
        description=(
            "What becomes of a recording that is cut off or damaged, or lacks one of its files: leave_out, or keep what"
            " can be read as an episode. Default: leave_out."
        ),
        examples=["keep"],
    )
    features: dict[FeatureName, FeatureSources] = Field(
        description=(
            "Columns of the dataset: `action`, and names that begin with `observation.`. TOPIC takes the topic's images"
            " as a video, TOPIC:FIELD numbers of its messages; a list joins numbers to one vector."
        ),
        examples=[{"observation.images.front": "/camera/image_raw", "action": "/cmd:data"}],
        json_schema_extra={
            "minProperties": 1,
            "required": [ACTION],
            "propertyNames": {"pattern": f"^({_FEATURE})$"},
        },
    )


class ExportKeys(Keys):
    """What `syncrelay export` makes of the sets; the relay itself passes over it."""

    lerobot: Annotated[LerobotKeys | None, NOT_NULL] = Field(
        default=None, description="A LeRobotDataset, for `export --format lerobot`. Default: none."
    )


@dataclass(frozen=True, slots=True)
class ExportSource:
    """An input by its full name, and a field of its messages; None if the messages are images."""

    topic: str
    field: str | None

    def __str__(self) -> str:
        return self.topic if self.field is None else f"{self.topic}:{self.field}"


@dataclass(frozen=True, slots=True)
class ExportFeature:
    """A column: a video of one source's images, or a vector of all sources' numbers in this order."""

    name: str
    sources: tuple[ExportSource, ...]

    @property
    def is_video(self) -> bool:
        """Whether it is a video."""
        return self.sources[0].field is None


@dataclass(frozen=True, slots=True)
class LerobotConfig:
    """How the sets of a group become a LeRobotDataset. `task` is a text, or the input and field that hold it."""

    group: str
    fps: int
    task: str | ExportSource
    max_gap_ns: int
    keeps_incomplete: bool
    features: tuple[ExportFeature, ...]


def sources_of(written: str | Sequence[str], node: NodeConfig) -> tuple[ExportSource, ...]:
    """Return the sources of a feature, whose topics are relative to the node's namespace."""
    texts = (written,) if isinstance(written, str) else written
    parts = (text.partition(":") for text in texts)
    return tuple(ExportSource(node.absolute(topic), path or None) for topic, _, path in parts)


def resolve_lerobot(keys: ExportKeys | None, node: NodeConfig, groups: Sequence[str]) -> LerobotConfig | None:
    """Return the section of a valid file with its defaults filled in; None if the file has none."""
    lerobot = None if keys is None else keys.lerobot
    if lerobot is None:
        return None
    task = lerobot.task
    return LerobotConfig(
        group=groups[0] if lerobot.group is None else lerobot.group,
        fps=lerobot.fps,
        task=task if isinstance(task, str) else ExportSource(node.absolute(task.topic), task.field),
        max_gap_ns=_FRAMES_OF_A_GAP * 10**9 // lerobot.fps if lerobot.max_gap is None else lerobot.max_gap,
        keeps_incomplete=lerobot.incomplete == "keep",
        features=tuple(ExportFeature(name, sources_of(each, node)) for name, each in lerobot.features.items()),
    )
