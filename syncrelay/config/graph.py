"""The groups of files as Mermaid, which Markdown pages draw, and as text: inputs, groups, outputs."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from syncrelay.config.load import Config
from syncrelay.config.resolved import GroupConfig
from syncrelay.printable import printable

_ANY_TYPE: Final = "type from the graph"
# The keys of a group that have no line of their own: they are shown by what is drawn.
_SHOWN_OTHERWISE: Final = ("policy", "topics", "output_prefix", "outputs", "bundle", "manifest", "trigger")
# All other characters have a meaning somewhere in Mermaid's grammar, or in HTML.
_NOT_PLAIN: Final = re.compile(r"[^A-Za-z0-9 _./,:~+-]")


@dataclass(frozen=True, slots=True)
class Box:
    """An input or a group: its name, and the lines below it."""

    name: str
    lines: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Path:
    """The way of a topic through a group: the number of its input's box, what the file says of it, its output."""

    input: int
    label: str
    is_optional: bool
    output: str


@dataclass(frozen=True, slots=True)
class Drawing:
    """All groups with their paths and the box of their bundle. An input of several groups has one box."""

    title: str
    inputs: tuple[Box, ...]
    groups: tuple[tuple[Box, tuple[Path, ...], Box | None], ...]


def drawing_of(config: Config, *, title: str) -> Drawing:
    """Return the drawing of the groups of files."""
    inputs: dict[str, Box] = {}
    groups = []
    for group in config.groups:
        paths = []
        for index, (name, topic) in enumerate(zip(group.inputs.names, group.topics, strict=True)):
            inputs.setdefault(name, Box(name, (topic.type or _ANY_TYPE,)))
            label = ", ".join(_said_of_topic(group, index, config))
            output = config.node.absolute(topic.output)
            paths.append(Path(list(inputs).index(name), label, not topic.required, output))
        bundle = None
        if group.bundle is not None:
            bundle = Box(config.node.absolute(group.bundle.topic), (group.bundle.type,))
        groups.append((_group_box(group, config), tuple(paths), bundle))
    return Drawing(printable(title), tuple(inputs.values()), tuple(groups))


def _group_box(group: GroupConfig, config: Config) -> Box:
    clock = () if group.ticks is None else (f"trigger {group.ticks}",)
    keys = [key for key in type(group.options).model_fields if key not in _SHOWN_OTHERWISE]
    written = {key: config.written((*group.path, key)) for key in keys}
    keyed = (f"{key} {text}" for key, text in written.items() if text is not None)
    return Box(group.name, (group.options.policy, *clock, *keyed))


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
    for index, each in enumerate(drawing.inputs):
        yield f'  i{index}["{_label(each)}"]'
    for at, (box, paths, bundle) in enumerate(drawing.groups):
        yield f'  g{at}("{_label(box)}")'
        for path in paths:
            label = f'|"{_escaped(path.label)}"|' if path.label else ""
            yield f"  i{path.input} {'-.->' if path.is_optional else '-->'}{label} g{at}"
        outputs = {path.output: Box(path.output, ()) for path in paths} | ({bundle.name: bundle} if bundle else {})
        yield from (f'  g{at} --> o{at}_{index}["{_label(each)}"]' for index, each in enumerate(outputs.values()))


def _label(box: Box) -> str:
    return "<br/>".join(map(_escaped, (box.name, *box.lines)))


def _escaped(text: str) -> str:
    return _NOT_PLAIN.sub(lambda found: f"#{ord(found.group())};", text)


def as_text(drawing: Drawing) -> Iterator[str]:
    """Yield lines for a terminal: each group, then a line for each input with its output."""
    yield drawing.title
    for box, paths, bundle in drawing.groups:
        yield ""
        yield f"{box.name}: {', '.join(box.lines)}"
        flows = [(_described(drawing.inputs[path.input], path.label), path.output) for path in paths]
        if bundle is not None:
            flows.append((_described(Box("whole sets", bundle.lines), ""), bundle.name))
        width = max(len(source) for source, _ in flows)
        yield from (f"  {source:<{width}} -> {output}" for source, output in flows)


def _described(box: Box, label: str) -> str:
    return f"{box.name} ({', '.join(filter(None, (*box.lines, label)))})"
