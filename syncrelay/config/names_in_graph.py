"""Conflicts between the names of a file as they are in the graph, with or without remaps.

Problems are the same with remaps, and shown where the file has the name.
"""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple, TypeAlias

from syncrelay.config.document import Document
from syncrelay.config.names import LONGEST_TOPIC
from syncrelay.config.problems import Path, Problem
from syncrelay.config.resolved import GroupConfig, TopicConfig
from syncrelay.config.sections import DiagnosticsConfig, NodeConfig
from syncrelay.config.wording import quoted

DIAGNOSTICS: Final = "/diagnostics"
SCALARS: Final = ("sets_hz", "span_ms", "latency_ms")
"""Figures of a group, each on a topic `~/GROUP/FIGURE`."""
_TRANSITIONS: Final = "~/transition_event"
MANIFEST_TYPE: Final = "diagnostic_msgs/msg/DiagnosticArray"


def manifest_topic(group: str) -> str:
    """Return the topic of a group's manifest, relative to the node."""
    return f"~/{group}/sets"


Resolve: TypeAlias = Callable[[str], str]
"""Turns a name in the file, relative or not, into the one in the graph."""


@dataclass(frozen=True, slots=True, eq=False)
class NamesInFile:
    """The names in a file and their places. Remaps are known only once ROS runs, so it can be checked again then.

    Of a file with faults it has what could be read.
    """

    node: NodeConfig
    groups: Sequence[GroupConfig]
    diagnostics: DiagnosticsConfig | None
    document: Document

    @property
    def written(self) -> tuple[str, ...]:
        """The names that `problems` resolves, each once."""
        names: dict[str, str] = {}
        for _ in self._problems(lambda name: names.setdefault(name, name), None):
            pass
        return tuple(names)

    def problems(self, resolve: Resolve, *, groups: Collection[str]) -> tuple[Problem, ...]:
        """Return the conflicts between the resolved names of these groups, in the order of the file."""
        return tuple(sorted(self._problems(resolve, groups), key=_place))

    def _problems(self, resolve: Resolve, groups: Collection[str] | None) -> Iterator[Problem]:
        chosen = [group for group in self.groups if groups is None or group.name in groups]
        by_group = [self._topics(group, resolve) for group in chosen]
        topics = [topic for of_group in by_group for topic in of_group]
        for of_group in by_group:
            yield from _repeated_inputs(of_group, self.document)
        yield from _shared_topics(topics, self.document)
        yield from _outputs(topics, self.document)
        yield from _too_long(topics, self.document)
        own = _own_topics(self.diagnostics, [group.name for group in chosen], resolve)
        if self.node.lifecycle:
            own[resolve(_TRANSITIONS)] = _OwnTopic("lifecycle_msgs/msg/TransitionEvent", "its transitions")
        for group in chosen:
            if group.options.manifest:
                manifest = _manifest(group, self.document, self.node.absolute, resolve)
                yield from _misnamed_manifest(manifest, own, topics, self.document)
                own.setdefault(manifest.text, _OwnTopic(MANIFEST_TYPE, f"the manifest of the group {group.name}"))
        yield from _meeting_own_topics(topics, own, self.document)

    def _topics(self, group: GroupConfig, resolve: Resolve) -> list["_Topic"]:
        return [_topic(topic, path, self.document, self.node.absolute, resolve) for path, topic in group.paths()]


def _place(problem: Problem) -> tuple[int, int, int]:
    span = problem.span
    return (span.source, span.line, span.column) if span else (0, 0, 0)


@dataclass(frozen=True, slots=True)
class _Name:
    """A name in the graph and the key that it comes from; empty if the file does not have it.

    `before` is the name in the file if a remap changed it.
    """

    text: str
    path: Path
    before: str = ""

    @property
    def said(self) -> str:
        """The name as the beginning of a sentence has it."""
        return f"{quoted(self.text)}{self.remapped}{',' if self.before else ''}"

    @property
    def remapped(self) -> str:
        """What a sentence adds to the name, or to its line."""
        return f", remapped from {quoted(self.before)}" if self.before else ""

    def line(self, document: Document, *, beside: Path) -> str:
        """Return the line that it comes from, for a sentence about what is at `beside`."""
        return document.line(self.path, beside=beside) + self.remapped


@dataclass(frozen=True, slots=True)
class _Topic:
    """A topic of the file with its names in the graph."""

    path: Path
    config: TopicConfig
    input: _Name
    output: _Name

    @property
    def has_own_output(self) -> bool:
        """Whether the file names its output."""
        return self.output.path[-1] == "output"


def _topic(config: TopicConfig, path: Path, document: Document, absolute: Resolve, resolve: Resolve) -> _Topic:
    def name(text: str, path: Path, *, known: bool) -> _Name:
        if not text or not known:
            return _Name("", path)
        before, after = absolute(text), resolve(text)
        return _Name(after, path, before if before != after else "")

    topic, output = (*path, "topic"), (*path, "output")
    if document.has(output):
        output_is_known = output not in document.faulty
    else:
        output_is_known = bool(config.topic) and (*path[:2], "output_prefix") not in document.faulty
        output = topic
    return _Topic(
        path,
        config,
        name(config.topic, topic, known=True),
        name(config.output, output, known=output_is_known),
    )


def _repeated_inputs(topics: Sequence[_Topic], document: Document) -> Iterator[Problem]:
    first: dict[str, _Name] = {}
    for name in (topic.input for topic in topics if topic.input.text):
        other = first.setdefault(name.text, name)
        if other is not name:
            text = f"{name.said} is in this group twice, first on {other.line(document, beside=name.path)}"
            yield document.problem(name.path, text, code="repeated_topic")


def _shared_types(topics: Sequence[_Topic], document: Document) -> Iterator[Problem]:
    first: dict[str, tuple[Path, str]] = {}
    for topic in topics:
        path, type_name = (*topic.path, "type"), topic.config.type
        if not topic.input.text or type_name is None or not document.has(path):
            continue
        other, others = first.setdefault(topic.input.text, (path, type_name))
        if type_name != others:
            line = document.line(other, beside=path)
            text = f"{topic.input.said} is {quoted(others)} on {line}, but a topic has only one type"
            yield document.problem(path, text, code="conflict")


def _shared_topics(topics: Sequence[_Topic], document: Document) -> Iterator[Problem]:
    yield from _shared_types(topics, document)
    first: dict[str, _Topic] = {}
    for topic in topics:
        other = first.setdefault(topic.input.text, topic) if topic.input.text else topic
        if other is topic:
            continue
        qos, others = _qos(topic, document), _qos(other, document)
        if topic.config.qos != other.config.qos and not {qos, others} & document.faulty:
            text = (
                f"{topic.input.said} has a different `qos` on {document.line(others, beside=qos)}: there is one"
                " subscription for both, write the same `qos`"
            )
            yield document.problem(qos, text, code="conflict")


def _qos(topic: _Topic, document: Document) -> Path:
    """Return where a topic's QoS is written; its name where it is not."""
    path = (*topic.path, "qos")
    return path if document.has(path) else topic.input.path


def _outputs(topics: Sequence[_Topic], document: Document) -> Iterator[Problem]:
    inputs = {topic.input.text: topic.input for topic in reversed(topics) if topic.input.text}
    first: dict[str, _Name] = {}
    for topic in topics:
        name = topic.output
        if not name.text:
            continue
        what = f"the output {name.said}" if topic.has_own_output else f"the default output {name.said}"
        other = first.setdefault(name.text, name)
        if name.text in inputs:
            line = inputs[name.text].line(document, beside=name.path)
            text = f"{what} is also an input ({line}), which makes a loop: choose another `output`"
            yield document.problem(name.path, text, code="loop")
        elif other is not name:
            text = f"{what} is already used on {other.line(document, beside=name.path)}: choose another `output`"
            yield document.problem(name.path, text, code="repeated_output")


def _too_long(topics: Sequence[_Topic], document: Document) -> Iterator[Problem]:
    """Yield names that are too long with their namespace or prefix."""
    for name in (name for topic in topics for name in (topic.input, topic.output)):
        if len(name.text) > LONGEST_TOPIC:
            text = f"the full name {quoted(name.text)} has {_too_many_characters(name)}"
            yield document.problem(name.path, text, code="bad_value")


def _too_many_characters(name: _Name) -> str:
    return f"{len(name.text)} characters, at most {LONGEST_TOPIC} are allowed"


class _OwnTopic(NamedTuple):
    """The type of a topic that the node publishes or listens to by itself, and what it is for."""

    type: str
    purpose: str


_OF_EVERY_NODE: Final = {
    "/rosout": _OwnTopic("rcl_interfaces/msg/Log", "its log"),
    "/parameter_events": _OwnTopic("rcl_interfaces/msg/ParameterEvent", "changes of its parameters"),
    "/clock": _OwnTopic("rosgraph_msgs/msg/Clock", "simulated time"),
}


def _own_topics(diagnostics: DiagnosticsConfig | None, groups: Sequence[str], resolve: Resolve) -> dict[str, _OwnTopic]:
    own = {resolve(name): topic for name, topic in _OF_EVERY_NODE.items()}
    if diagnostics is not None:
        own[resolve(DIAGNOSTICS)] = _OwnTopic("diagnostic_msgs/msg/DiagnosticArray", "its diagnostics")
    if diagnostics is not None and diagnostics.scalars:
        for group in groups:
            for figure in SCALARS:
                purpose = f"`{figure}` of the group {group}"
                own[resolve(f"~/{group}/{figure}")] = _OwnTopic("std_msgs/msg/Float64", purpose)
    return own


def _manifest(group: GroupConfig, document: Document, absolute: Resolve, resolve: Resolve) -> _Name:
    name, path = manifest_topic(group.name), (*group.path, "manifest")
    before, after = absolute(name), resolve(name)
    return _Name(after, path if document.has(path) else group.path, before if before != after else "")


def _misnamed_manifest(
    name: _Name, own: dict[str, _OwnTopic], topics: Sequence[_Topic], document: Document
) -> Iterator[Problem]:
    """Yield what is wrong with the name of a manifest: its length, what else it names."""
    span = document.value_span(name.path) if name.path[-1] == "manifest" else document.key_span(name.path)
    instead = "remap it to another name, or set `manifest: false`"
    if len(name.text) > LONGEST_TOPIC:
        text = f"the full name of its manifest, {quoted(name.text)}, has {_too_many_characters(name)}"
        yield document.problem(name.path, text, code="bad_value", span=span)
    taken = own.get(name.text)
    if taken is not None:
        text = f"its manifest {name.said} is a topic that the node itself uses for {taken.purpose}: {instead}"
        yield document.problem(name.path, text, code="own_topic", span=span)
    for topic in topics:
        if topic.input.text == name.text and topic.config.type in (None, MANIFEST_TYPE):
            text = f"{topic.input.said} is the manifest of a group of the same node, which makes a loop"
            yield document.problem(topic.input.path, text, code="loop")


def _meeting_own_topics(topics: Sequence[_Topic], own: dict[str, _OwnTopic], document: Document) -> Iterator[Problem]:
    """Yield outputs onto the node's own topics, and inputs that make another type of one: DDS refuses both."""
    for topic in topics:
        taken = own.get(topic.output.text)
        if taken is not None:
            text = (
                f"the output {topic.output.said} is a topic that the node itself uses for {taken.purpose}:"
                " choose another `output`"
            )
            yield document.problem(topic.output.path, text, code="own_topic")
        taken = own.get(topic.input.text)
        if taken is not None and topic.config.type not in (None, taken.type):
            text = (
                f"{topic.input.said} is a topic that the node itself uses for {taken.purpose}, with the type"
                f" `{taken.type}`: a topic has only one type"
            )
            yield document.problem((*topic.path, "type"), text, code="conflict")
