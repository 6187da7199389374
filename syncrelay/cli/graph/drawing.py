"""What a drawing of groups shows: inputs, groups, outputs and the lines between them, whatever it is drawn with."""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Final

from syncrelay.config import Config, GroupConfig, TopicConfig
from syncrelay.config.wording import counted
from syncrelay.explain.words import figure
from syncrelay.printable import printable

if TYPE_CHECKING:
    from syncrelay.status.document import Group, Input, Status

_ANY_TYPE: Final = "type from the graph"
_MOST_WORDS: Final = 200
"""Characters of a finding: more is for `top`."""
_SHOWN_OTHERWISE: Final = ("policy", "topics", "output_prefix", "manifest", "trigger")


class Mark(Enum):
    """How a running relay fares; NONE where none was asked."""

    NONE = "none"
    OK = "ok"
    WARN = "warn"
    ERROR = "error"
    STALE = "stale"


@dataclass(frozen=True, slots=True)
class Box:
    """A topic or a group: its name, what is said below it, and what a running relay found."""

    name: str
    lines: tuple[str, ...] = ()
    finding: str | None = None
    mark: Mark = Mark.NONE


@dataclass(frozen=True, slots=True)
class Link:
    """From an input, by its index among those of the drawing, to a group; dashed where sets may leave without it."""

    input: int
    label: str
    is_dashed: bool


@dataclass(frozen=True, slots=True)
class GroupBox:
    """A group with what leads to it and its outputs."""

    box: Box
    links: tuple[Link, ...]
    outputs: tuple[Box, ...]


@dataclass(frozen=True, slots=True)
class Drawing:
    """All groups; an input that several of them use is there once."""

    title: str
    inputs: tuple[Box, ...]
    groups: tuple[GroupBox, ...]


def drawing_of(config: Config, *, title: str, state: "Status | None" = None) -> Drawing:
    """Return the drawing of a file's groups, with what a running relay says of those that it runs."""
    running = {group.name: group for group in state.groups} if state is not None else {}
    topics: dict[str, tuple[TopicConfig, Input | None]] = {}
    for group in config.groups:
        live = running.get(group.name)
        for index, (name, topic) in enumerate(zip(group.inputs.names, group.topics, strict=True)):
            seen = _input_of(live, name, index, len(group.topics))
            if name not in topics or topics[name][1] is None:
                topics[name] = topic, seen
    order = {name: index for index, name in enumerate(topics)}
    return Drawing(
        printable(title),
        tuple(_input_box(name, topic, live) for name, (topic, live) in topics.items()),
        tuple(_group_box(group, order, config, running.get(group.name)) for group in config.groups),
    )


def _input_of(group: "Group | None", name: str, index: int, count: int) -> "Input | None":
    """Return what a running group says of one of its inputs: by its name, or its place where a remap changed that."""
    if group is None:
        return None
    by_name = next((each for each in group.inputs if each.topic == name), None)
    return by_name or (group.inputs[index] if len(group.inputs) == count else None)


def _input_box(name: str, topic: TopicConfig, live: "Input | None") -> Box:
    type_name = (live.type if live is not None else None) or topic.type or _ANY_TYPE
    if live is None:
        return Box(name, (type_name,))
    rate = f"{figure(live.rate_hz)} Hz" if live.rate_hz else "no messages"
    other_name = () if live.topic == name else (f"as {live.topic}",)
    return Box(name, (type_name, *other_name, rate), mark=Mark.OK if live.rate_hz else Mark.STALE)


def _output_box(name: str, live: "Input | None") -> Box:
    return Box(name, () if live is None else (counted(len(live.subscribers), "subscriber"),))


def _group_box(group: GroupConfig, order: dict[str, int], config: Config, live: "Group | None") -> GroupBox:
    inputs = list(zip(group.inputs.names, group.topics, strict=True))
    links = tuple(
        Link(order[name], ", ".join(_of_link(group, index, config)), is_dashed=not topic.required)
        for index, (name, topic) in enumerate(inputs)
    )
    outputs = tuple(
        _output_box(config.node.absolute(topic.output), _input_of(live, name, index, len(inputs)))
        for index, (name, topic) in enumerate(inputs)
    )
    clock = () if group.ticks is None else (f"trigger {group.ticks}",)
    lines = (group.options.policy, *clock, *_options(group, config))
    if live is None:
        return GroupBox(Box(group.name, lines), links, outputs)
    rate = f"{figure(live.rate_hz)} of {figure(max(live.possible_hz, live.rate_hz))} sets/s"
    box = Box(group.name, (*lines, f"{live.level.name}, {rate}"), _finding(live), Mark(live.level.value))
    return GroupBox(box, links, outputs)


def _finding(group: "Group") -> str | None:
    if not group.problems:
        return None
    text = f"{group.problems[0].label}: {group.problems[0].text}"
    return text if len(text) <= _MOST_WORDS else f"{text[: _MOST_WORDS - 1]}…"


def _options(group: GroupConfig, config: Config) -> Iterator[str]:
    for key in type(group.options).model_fields:
        written = config.written((*group.path, key))
        if key not in _SHOWN_OTHERWISE and written is not None:
            yield f"{key} {written}"


def _of_link(group: GroupConfig, index: int, config: Config) -> Iterator[str]:
    if group.trigger == index:
        yield "trigger"
    if not group.topics[index].required:
        yield "optional"
    for key in ("offset", "stamp", "key"):
        written = config.written((*group.path, "topics", index, key))
        if written is not None:
            yield f"{key} {written}"
