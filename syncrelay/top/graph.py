"""The groups of files as Mermaid, which Markdown pages draw, and as text: inputs, groups, outputs, live figures."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Final

from syncrelay.config import Config, GroupConfig, TopicConfig
from syncrelay.config.wording import counted
from syncrelay.explain.words import figure
from syncrelay.printable import printable
from syncrelay.status.document import Group, Input, Status

_ANY_TYPE: Final = "type from the graph"
# The keys of a group that have no line of their own: they are shown by what is drawn.
_SHOWN_OTHERWISE: Final = ("policy", "topics", "output_prefix", "manifest", "trigger")
# Characters of a finding; `top` shows all of it.
_LONGEST_FINDING: Final = 200
# All other characters have a meaning somewhere in Mermaid's grammar, or in HTML.
_NOT_PLAIN: Final = re.compile(r"[^A-Za-z0-9 _./,:~+-]")


class Mark(Enum):
    """How a group or an input of a running relay fares; NONE where no relay was asked."""

    NONE = "none"
    OK = "ok"
    WARN = "warn"
    ERROR = "error"
    STALE = "stale"


# Borders alone are coloured, so that a drawing can be read on a light and on a dark page.
_STYLES: Final = {
    Mark.OK: "stroke:#2da44e,stroke-width:2px",
    Mark.WARN: "stroke:#bf8700,stroke-width:3px",
    Mark.ERROR: "stroke:#cf222e,stroke-width:3px",
    Mark.STALE: "stroke-dasharray:4 3",
}


@dataclass(frozen=True, slots=True)
class Box:
    """A topic or a group: its name, the lines below it, and the finding of a running relay that explains most."""

    name: str
    lines: tuple[str, ...] = ()
    finding: str | None = None
    mark: Mark = Mark.NONE


@dataclass(frozen=True, slots=True)
class Path:
    """The way of a topic through a group: the number of its input's box, what the file says of it, its output."""

    input: int
    label: str
    is_optional: bool
    output: Box


@dataclass(frozen=True, slots=True)
class Drawing:
    """All groups with their paths. An input of several groups has one box."""

    title: str
    inputs: tuple[Box, ...]
    groups: tuple[tuple[Box, tuple[Path, ...]], ...]


def drawing_of(config: Config, *, title: str, status: Status | None = None) -> Drawing:
    """Return the drawing of a file's groups, with what a running relay says of those that it runs."""
    running = {group.name: group for group in status.groups} if status is not None else {}
    inputs: dict[str, Box] = {}
    groups = []
    for group in config.groups:
        live = running.get(group.name)
        paths = []
        for index, (name, topic) in enumerate(zip(group.inputs.names, group.topics, strict=True)):
            seen = _input_of(live, name, index, len(group.topics))
            if name not in inputs or inputs[name].mark is Mark.NONE:
                inputs[name] = _input_box(name, topic, seen)
            subscribers = () if seen is None else (counted(len(seen.subscribers), "subscriber"),)
            output = Box(config.node.absolute(topic.output), subscribers)
            label = ", ".join(_said_of_topic(group, index, config))
            paths.append(Path(list(inputs).index(name), label, not topic.required, output))
        groups.append((_group_box(group, config, live), tuple(paths)))
    return Drawing(printable(title), tuple(inputs.values()), tuple(groups))


def _input_of(group: Group | None, name: str, index: int, count: int) -> Input | None:
    """Return what a running group says of an input: by its name, or its place where a remap changed the name."""
    if group is None:
        return None
    by_name = next((each for each in group.inputs if each.topic == name), None)
    return by_name or (group.inputs[index] if len(group.inputs) == count else None)


def _input_box(name: str, topic: TopicConfig, live: Input | None) -> Box:
    type_name = (live.type if live is not None else None) or topic.type or _ANY_TYPE
    if live is None:
        return Box(name, (type_name,))
    rate = f"{figure(live.rate_hz)} Hz" if live.rate_hz else "no messages"
    other_name = () if live.topic == name else (f"as {live.topic}",)
    return Box(name, (type_name, *other_name, rate), mark=Mark.OK if live.rate_hz else Mark.STALE)


def _group_box(group: GroupConfig, config: Config, live: Group | None) -> Box:
    clock = () if group.ticks is None else (f"trigger {group.ticks}",)
    keys = [key for key in type(group.options).model_fields if key not in _SHOWN_OTHERWISE]
    written = {key: config.written((*group.path, key)) for key in keys}
    lines = (group.options.policy, *clock, *(f"{key} {text}" for key, text in written.items() if text is not None))
    if live is None:
        return Box(group.name, lines)
    rate = f"{figure(live.rate_hz)} of {figure(max(live.possible_hz, live.rate_hz))} sets/s"
    finding = f"{live.problems[0].label}: {live.problems[0].text}" if live.problems else None
    if finding is not None and len(finding) > _LONGEST_FINDING:
        finding = f"{finding[: _LONGEST_FINDING - 1]}…"
    return Box(group.name, (*lines, f"{live.level.name}, {rate}"), finding, Mark(live.level.value))


def _said_of_topic(group: GroupConfig, index: int, config: Config) -> Iterator[str]:
    if group.trigger == index:
        yield "trigger"
    if not group.topics[index].required:
        yield "optional"
    for key in ("offset", "stamp", "key"):
        written = config.written((*group.path, "topics", index, key))
        if written is not None:
            yield f"{key} {written}"


def as_mermaid(drawing: Drawing) -> Iterator[str]:
    """Yield the lines of a Mermaid flowchart."""
    yield from ("---", f'title: "{_NOT_PLAIN.sub("?", drawing.title)}"', "---", "flowchart LR")
    marks: dict[str, Mark] = {}
    for index, each in enumerate(drawing.inputs):
        marks[f"i{index}"] = each.mark
        yield f'  i{index}["{_label(each)}"]'
    for at, (box, paths) in enumerate(drawing.groups):
        marks[f"g{at}"] = box.mark
        yield f'  g{at}("{_label(box)}")'
        for path in paths:
            label = f'|"{_escaped(path.label)}"|' if path.label else ""
            yield f"  i{path.input} {'-.->' if path.is_optional else '-->'}{label} g{at}"
        yield from (f'  g{at} --> o{at}_{index}["{_label(path.output)}"]' for index, path in enumerate(paths))
    for mark, style in _STYLES.items():
        names = [name for name, its in marks.items() if its is mark]
        if names:
            yield f"  classDef {mark.value} {style}"
            yield f"  class {','.join(names)} {mark.value}"


def _label(box: Box) -> str:
    lines = [box.name, *box.lines, *([box.finding] if box.finding else [])]
    return "<br/>".join(map(_escaped, lines))


def _escaped(text: str) -> str:
    return _NOT_PLAIN.sub(lambda found: f"#{ord(found.group())};", text)


def as_text(drawing: Drawing) -> Iterator[str]:
    """Yield lines for a terminal: each group, then a line for each input with its output."""
    yield drawing.title
    for box, paths in drawing.groups:
        yield ""
        yield f"{box.name}: {', '.join(box.lines)}"
        if box.finding:
            yield f"  {box.finding}"
        inputs = [_described(drawing.inputs[path.input], path.label) for path in paths]
        width = max(map(len, inputs))
        yield from (f"  {each:<{width}} -> {_described(path.output)}" for each, path in zip(inputs, paths, strict=True))


def _described(box: Box, label: str = "") -> str:
    more = ", ".join(each for each in (*box.lines, label) if each)
    return f"{box.name} ({more})" if more else box.name
