"""Conflicts between the names of a file as they are in the graph, with or without remaps.

Problems are the same with remaps, and shown where the file has the name.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple, TypeAlias, TypeVar

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
        _Graph(self, self.groups, lambda name: names.setdefault(name, name))
        return tuple(names)

    def problems(self, resolve: Resolve, *, groups: Collection[str]) -> tuple[Problem, ...]:
        """Return the conflicts between the resolved names of these groups, in the order of the file."""
        graph = _Graph(self, [group for group in self.groups if group.name in groups], resolve)
        return tuple(sorted(graph.problems(), key=_place))


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

    @property
    def excess(self) -> str:
        """What a sentence says of a name that is too long; empty for others."""
        length = len(self.text)
        return f"has {length} characters, at most {LONGEST_TOPIC} are allowed" if length > LONGEST_TOPIC else ""


@dataclass(frozen=True, slots=True)
class _Topic:
    """A topic of the file with its names in the graph, and where its QoS is written, or else its name."""

    path: Path
    config: TopicConfig
    input: _Name
    output: _Name
    qos: Path


class _OwnTopic(NamedTuple):
    """The type of a topic that the node publishes or listens to by itself, and what it is for."""

    type: str
    purpose: str


_OF_EVERY_NODE: Final = {
    "/rosout": _OwnTopic("rcl_interfaces/msg/Log", "its log"),
    "/parameter_events": _OwnTopic("rcl_interfaces/msg/ParameterEvent", "changes of its parameters"),
    "/clock": _OwnTopic("rosgraph_msgs/msg/Clock", "simulated time"),
}


def _own_topics(file: NamesInFile, groups: Sequence[GroupConfig]) -> Iterator[tuple[str, _OwnTopic]]:
    """Yield the node's own topics but the manifests, by their names in the file."""
    yield from _OF_EVERY_NODE.items()
    if file.diagnostics is not None:
        yield DIAGNOSTICS, _OwnTopic("diagnostic_msgs/msg/DiagnosticArray", "its diagnostics")
    if file.diagnostics is not None and file.diagnostics.scalars:
        for name in (group.name for group in groups):
            for figure in SCALARS:
                yield f"~/{name}/{figure}", _OwnTopic("std_msgs/msg/Float64", f"`{figure}` of the group {name}")
    if file.node.lifecycle:
        yield _TRANSITIONS, _OwnTopic("lifecycle_msgs/msg/TransitionEvent", "its transitions")


_Named = TypeVar("_Named")


def _repeats(named: Iterable[tuple[str, _Named]]) -> Iterator[tuple[_Named, _Named]]:
    """Yield what has a name that something before it has, with the first that has it. An empty name is none."""
    first: dict[str, _Named] = {}
    for name, each in named:
        if name and first.setdefault(name, each) is not each:
            yield each, first[name]


class _Graph:
    """The names of some groups, and of the node's own topics, as they are in the graph."""

    def __init__(self, file: NamesInFile, groups: Sequence[GroupConfig], resolve: Resolve) -> None:
        self._document, self._absolute, self._resolve = file.document, file.node.absolute, resolve
        self._by_group = [[self._topic(group, topic, path) for path, topic in group.paths()] for group in groups]
        self._topics = [topic for topics in self._by_group for topic in topics]
        bundles = [(group.bundle.topic, (*group.path, "bundle", "topic")) for group in groups if group.bundle]
        self._outputs = [topic.output for topic in self._topics if topic.output.text]
        self._outputs += [self._name(topic, path) for topic, path in bundles]
        self._manifests = {group.name: self._manifest(group) for group in groups if group.options.manifest}
        self._own = {resolve(name): topic for name, topic in _own_topics(file, groups)}

    def problems(self) -> Iterator[Problem]:
        yield from self._shared_inputs()
        yield from self._meeting_outputs()
        for name in (*(topic.input for topic in self._topics), *self._outputs):
            if name.excess:
                yield self._problem(name.path, f"the full name {quoted(name.text)} {name.excess}", code="bad_value")
        for group, manifest in self._manifests.items():
            yield from self._misnamed_manifest(manifest)
            self._own.setdefault(manifest.text, _OwnTopic(MANIFEST_TYPE, f"the manifest of the group {group}"))
        yield from self._meeting_own_topics()

    def _name(self, text: str, path: Path) -> _Name:
        before, after = self._absolute(text), self._resolve(text)
        return _Name(after, path, before if before != after else "")

    def _topic(self, group: GroupConfig, config: TopicConfig, path: Path) -> _Topic:
        topic, output, qos = ((*path, key) for key in ("topic", "output", "qos"))
        is_named = self._document.has(output)
        # A default output is known if what it is made of is.
        needed = output if is_named else (*path[:2], "output_prefix")
        is_known = bool(config.topic or is_named) and needed not in self._document.faulty and group.options.outputs
        written = output if is_named else topic
        return _Topic(
            path,
            config,
            input=self._name(config.topic, topic) if config.topic else _Name("", topic),
            output=self._name(config.output, written) if is_known and config.output else _Name("", written),
            qos=qos if self._document.has(qos) else topic,
        )

    def _manifest(self, group: GroupConfig) -> _Name:
        path = (*group.path, "manifest")
        return self._name(manifest_topic(group.name), path if self._document.has(path) else group.path)

    def _problem(self, path: Path, text: str, *, code: str) -> Problem:
        return self._document.problem(path, text, code=code)

    def _line(self, name: _Name, *, beside: Path) -> str:
        """Return the line that a name comes from, for a sentence about what is at `beside`."""
        return self._document.line(name.path, beside=beside) + name.remapped

    def _shared_inputs(self) -> Iterator[Problem]:
        """Yield inputs that a group has twice, and those that differ where all groups share a subscription."""
        for topics in self._by_group:
            for name, first in _repeats((topic.input.text, topic.input) for topic in topics):
                text = f"{name.said} is in this group twice, first on {self._line(first, beside=name.path)}"
                yield self._problem(name.path, text, code="repeated_topic")
        typed = [topic for topic in self._topics if topic.config.type and self._document.has((*topic.path, "type"))]
        for topic, other in _repeats((topic.input.text, topic) for topic in typed):
            path, types = (*topic.path, "type"), (topic.config.type, str(other.config.type))
            if types[0] != types[1]:
                line = self._document.line((*other.path, "type"), beside=path)
                text = f"{topic.input.said} is {quoted(types[1])} on {line}, but a topic has only one type"
                yield self._problem(path, text, code="conflict")
        for topic, other in _repeats((topic.input.text, topic) for topic in self._topics):
            if topic.config.qos != other.config.qos and not {topic.qos, other.qos} & self._document.faulty:
                text = (
                    f"{topic.input.said} has a different `qos` on {self._document.line(other.qos, beside=topic.qos)}:"
                    " there is one subscription for both, write the same `qos`"
                )
                yield self._problem(topic.qos, text, code="conflict")

    def _meeting_outputs(self) -> Iterator[Problem]:
        inputs = {topic.input.text: topic.input for topic in reversed(self._topics)}
        first: dict[str, _Name] = {}
        for name in self._outputs:
            what, key = _said_of_output(name)
            other = first.setdefault(name.text, name)
            if name.text in inputs:
                line = self._line(inputs[name.text], beside=name.path)
                text = f"{what} is also an input ({line}), which makes a loop: choose another `{key}`"
                yield self._problem(name.path, text, code="loop")
            elif other is not name:
                line = self._line(other, beside=name.path)
                text = f"{what} is already used on {line}: choose another `{key}`"
                yield self._problem(name.path, text, code="repeated_output")

    def _misnamed_manifest(self, name: _Name) -> Iterator[Problem]:
        """Yield what is wrong with the name of a manifest: its length, what else it names."""
        span = (self._document.value_span if name.path[-1] == "manifest" else self._document.key_span)(name.path)
        instead = "remap it to another name, or set `manifest: false`"
        if name.excess:
            text = f"the full name of its manifest, {quoted(name.text)}, {name.excess}"
            yield self._document.problem(name.path, text, code="bad_value", span=span)
        if (taken := self._own.get(name.text)) is not None:
            text = f"its manifest {name.said} is a topic that the node itself uses for {taken.purpose}: {instead}"
            yield self._document.problem(name.path, text, code="own_topic", span=span)
        for topic in self._topics:
            if topic.input.text == name.text and topic.config.type in (None, MANIFEST_TYPE):
                text = f"{topic.input.said} is the manifest of a group of the same node, which makes a loop"
                yield self._problem(topic.input.path, text, code="loop")

    def _meeting_own_topics(self) -> Iterator[Problem]:
        """Yield outputs onto the node's own topics, and other types of these: DDS refuses both."""
        for name in self._outputs:
            if (taken := self._own.get(name.text)) is not None:
                what, key = _said_of_output(name)
                what = what.removeprefix("the default ").removeprefix("the ")
                text = f"the {what} is a topic that the node itself uses for {taken.purpose}: choose another `{key}`"
                yield self._problem(name.path, text, code="own_topic")
        for topic in self._topics:
            taken = self._own.get(topic.input.text)
            if taken is not None and topic.config.type not in (None, taken.type):
                text = (
                    f"{topic.input.said} is a topic that the node itself uses for {taken.purpose}, with the type"
                    f" `{taken.type}`: a topic has only one type"
                )
                yield self._problem((*topic.path, "type"), text, code="conflict")


def _said_of_output(name: _Name) -> tuple[str, str]:
    """Return how a sentence about an output or a bundle begins, and the key that gives it another name."""
    if "bundle" in name.path[2:]:
        return f"the bundle {name.said}", "topic"
    return f"the {'' if name.path[-1] == 'output' else 'default '}output {name.said}", "output"
