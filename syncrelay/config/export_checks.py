"""Checks between the keys of `export` and the groups: unknown inputs, fields of the wrong type, no action."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from syncrelay.config.document import Document, SequenceNode
from syncrelay.config.export import ACTION, ExportKeys, ExportSource, LerobotKeys, TaskTopic, sources_of
from syncrelay.config.interfaces import PRIMITIVES
from syncrelay.config.problems import Path, Problem
from syncrelay.config.resolved import GroupConfig
from syncrelay.config.sections import NodeConfig
from syncrelay.config.typechecks import TypeChecks, Wanted
from syncrelay.config.wording import all_of, one_of, or_nearest, quoted

IMAGES: Final = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
"""The types that become video."""

_PATH: Final = ("export", "lerobot")
_TEXTS: Final = frozenset(["string", "wstring"])
_A_TEXT: Final = Wanted(_TEXTS, "a string")
_NUMBERS: Final = Wanted(
    PRIMITIVES - _TEXTS, "numbers", in_arrays=PRIMITIVES - _TEXTS - {"uint8", "byte", "char"}, takes_messages=True
)


def check_export(
    keys: ExportKeys | None,
    node: NodeConfig,
    groups: Sequence[GroupConfig],
    document: Document,
    types: TypeChecks | None,
) -> Iterator[Problem]:
    """Yield conflicts between the keys of `export`, and between them and the groups.

    Fields are looked for in the types that the file names, where `types` can be checked.
    """
    lerobot = None if keys is None else keys.lerobot
    if lerobot is None:
        return
    yield from _features(lerobot, document)
    chosen = [group for group in groups if lerobot.group in (None, group.name)]
    if len(chosen) == 1:
        yield from _Sources(lerobot, node, chosen[0], document, types).problems()
    elif groups and (*_PATH, "group") not in document.faulty:
        yield _group(lerobot, [group.name for group in groups], document)


def _group(lerobot: LerobotKeys, names: Sequence[str], document: Document) -> Problem:
    if lerobot.group is None:
        text = f"missing, the file has {all_of(names)}: say which one, for example `group: {names[0]}`"
        return document.problem((*_PATH, "group"), text, code="missing", span=document.key_span(_PATH))
    text = f"there is no group {quoted(lerobot.group)}{or_nearest(document.nearest(lerobot.group, names))}"
    return document.problem((*_PATH, "group"), text, code="bad_value")


def _features(lerobot: LerobotKeys, document: Document) -> Iterator[Problem]:
    path = (*_PATH, "features")
    if path in document.faulty:
        return
    if ACTION not in lerobot.features and (*path, ACTION) not in document.faulty:
        text = "missing `action`, what the robot was told to do, for example `action: /cmd:data`"
        yield document.problem(path, text, code="missing", span=document.key_span(path))
    for name, written in lerobot.features.items():
        is_video = isinstance(written, str) and ":" not in written
        if name == ACTION and is_video:
            text = f"an action is numbers: expected TOPIC:FIELD, found the topic {quoted(str(written))} alone"
            yield document.problem((*path, name), text, code="bad_value")
        elif "image" in name and not is_video:
            text = "readers of LeRobot take a name with `image` in it for a video: give these numbers another name"
            yield document.problem((*path, name), text, code="bad_value", span=document.key_span((*path, name)))


@dataclass(frozen=True, slots=True)
class _Sources:
    """The topics and fields that the section names, and the group that has them as inputs."""

    lerobot: LerobotKeys
    node: NodeConfig
    group: GroupConfig
    document: Document
    types: TypeChecks | None

    def problems(self) -> Iterator[Problem]:
        task = self.lerobot.task
        if isinstance(task, TaskTopic):
            source = ExportSource(self.node.absolute(task.topic), task.field)
            yield from self._source(source, (*_PATH, "task", "topic"), (*_PATH, "task", "field"), _A_TEXT)
        for name, written in self.lerobot.features.items():
            path = (*_PATH, "features", name)
            is_list = isinstance(self.document.find(path), SequenceNode)
            for index, source in enumerate(sources_of(written, self.node)):
                place = (*path, index) if is_list else path
                yield from self._source(source, place, place, _NUMBERS)

    def _source(self, source: ExportSource, topic: Path, field: Path, wanted: Wanted) -> Iterator[Problem]:
        inputs = dict(zip(self.group.inputs.names, self.group.topics, strict=True))
        type_name = inputs[source.topic].type if source.topic in inputs else None
        if source.topic not in inputs:
            close = self.document.nearest(source.topic, inputs)
            found = self.document.filled_in(topic) or quoted(source.topic)
            text = f"{found} is not an input of the group {self.group.name}{or_nearest(close)}"
            yield self.document.problem(topic, text, code="bad_value")
        elif type_name is not None and source.field is None and type_name not in IMAGES:
            text = (
                f"{source.topic} is {type_name}, expected {one_of(IMAGES)}; for numbers write their field too,"
                " TOPIC:FIELD"
            )
            if filled_in := self.document.filled_in(field):
                text = f"expected a topic of images, or TOPIC:FIELD, found {filled_in}"
            yield self.document.problem(field, text, code="no_such_field", subject=type_name)
        elif type_name is not None and source.field is not None and self.types is not None:
            yield from self.types.of_field(type_name, field, source.field, wanted)
