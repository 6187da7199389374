"""What single keys of `export` can't tell: topics that are no inputs, fields that are no numbers, no action."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from syncrelay.config.document import Document, SequenceNode
from syncrelay.config.export import ACTION, ExportKeys, ExportSource, LerobotKeys, TaskTopic, sources_of
from syncrelay.config.interfaces import PRIMITIVES, Interfaces
from syncrelay.config.problems import Path, Problem
from syncrelay.config.resolved import GroupConfig, TopicConfig
from syncrelay.config.sections import NodeConfig
from syncrelay.config.wording import all_of, one_of, or_nearest, quoted

IMAGES: Final = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
"""The types that become video."""

_PATH: Final = ("export", "lerobot")
_TEXTS: Final = frozenset(["string", "wstring"])
_BYTES: Final = frozenset(["uint8", "byte", "char"])


def check_export(
    keys: ExportKeys | None,
    node: NodeConfig,
    groups: Sequence[GroupConfig],
    document: Document,
    interfaces: Interfaces | None,
) -> Iterator[Problem]:
    """Yield what is wrong between the keys of `export`, and between them and the groups.

    Fields are looked for in types that the file names, where `interfaces` has them.
    """
    lerobot = None if keys is None else keys.lerobot
    if lerobot is None:
        return
    yield from _features(lerobot, document)
    chosen = [group for group in groups if lerobot.group in (None, group.name)]
    if len(chosen) == 1:
        yield from _Sources(lerobot, node, chosen[0], document, interfaces).problems()
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
    interfaces: Interfaces | None

    def problems(self) -> Iterator[Problem]:
        task = self.lerobot.task
        if isinstance(task, TaskTopic):
            source = ExportSource(self.node.absolute(task.topic), task.field)
            yield from self._source(source, (*_PATH, "task", "topic"), (*_PATH, "task", "field"), _TEXTS)
        for name, written in self.lerobot.features.items():
            path = (*_PATH, "features", name)
            is_list = isinstance(self.document.find(path), SequenceNode)
            for index, source in enumerate(sources_of(written, self.node)):
                place = (*path, index) if is_list else path
                yield from self._source(source, place, place, PRIMITIVES - _TEXTS)

    def _source(self, source: ExportSource, topic: Path, field: Path, wanted: frozenset[str]) -> Iterator[Problem]:
        inputs = dict(zip(self.group.inputs.names, self.group.topics, strict=True))
        config = inputs.get(source.topic)
        if config is None:
            close = self.document.nearest(source.topic, inputs)
            found = self.document.filled_in(topic) or quoted(source.topic)
            text = f"{found} is not an input of the group {self.group.name}{or_nearest(close)}"
            yield self.document.problem(topic, text, code="bad_value")
        elif config.type is not None:
            text = self._fault(source, config, wanted)
            if text:
                if filled_in := self.document.filled_in(field):
                    text = f"expected a field of {config.type} of another type, found {filled_in}"
                yield self.document.problem(field, text, code="no_such_field", subject=config.type)

    def _fault(self, source: ExportSource, config: TopicConfig, wanted: frozenset[str]) -> str:
        """Say what is wrong with a source whose type is known."""
        type_name = config.type or ""
        if source.field is None:
            if type_name in IMAGES:
                return ""
            return (
                f"{source.topic} is {type_name}, expected {one_of(IMAGES)}; for numbers write their field too,"
                " TOPIC:FIELD"
            )
        steps = source.field.split(".")
        return "" if self.interfaces is None else _field_fault(type_name, steps, wanted, self.interfaces, self.document)


def _field_fault(
    type_name: str, steps: Sequence[str], wanted: frozenset[str], interfaces: Interfaces, document: Document
) -> str:
    """Follow a path of fields; say where it misses what is wanted, nothing where that cannot be told."""
    first, *rest = steps
    fields = interfaces.fields(type_name)
    if fields is None:
        return ""
    by_name = {field.name: field for field in fields}
    field = by_name.get(first)
    if field is None:
        close = document.nearest(first, by_name)
        return f"{type_name} has no field {quoted(first)}{or_nearest(close) or f', it has {one_of(by_name)}'}"
    if rest and not field.is_array and field.type not in PRIMITIVES:
        return _field_fault(field.type, rest, wanted, interfaces, document)
    found = f"{field.type}[]" if field.is_array else field.type
    if rest:
        return f"{quoted(first)} of {type_name} is {found}, and `{rest[0]}` is looked for in it"
    is_text_wanted = wanted == _TEXTS
    is_fit = field.type in wanted and not (field.is_array and (is_text_wanted or field.type in _BYTES))
    # Of a message, all its fields are taken: the recording tells whether they are numbers.
    if is_fit or (field.type not in PRIMITIVES and not field.is_array and not is_text_wanted):
        return ""
    return f"{quoted(first)} of {type_name} is {found}, expected {'a string' if is_text_wanted else 'numbers'}"
