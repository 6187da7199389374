"""A YAML file as a tree in which every key and value knows where it stands."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple, TypeAlias

from syncrelay.config.problems import ConfigError, Path, Problem, Severity, Span, dotted
from syncrelay.config.source import Source
from syncrelay.config.wording import LIKENESS, FilledIn, nearest, or_nearest, without_value
from syncrelay.printable import printable

Scalar: TypeAlias = str | int | float | bool | None

EXTENSION: Final = "x-"
"""Keys with this prefix are ignored, as in Compose files: users keep anchors and notes there."""

MOST_VALUES: Final = 200_000
"""The most values a file may have with aliases and defaults expanded. A thousand groups are a tenth of it."""

MOST_GUESSES: Final = 1000
"""The most suggestions that are searched for in one file: each search is far slower than reading the word."""


@dataclass(slots=True)
class ScalarNode:
    """A value. `readable` is false if it could not be read and a problem was reported.

    `size` counts a long text as several values. `written` is the text in the file if it has variables, else None.
    """

    span: Span
    value: Scalar
    readable: bool = True
    size: int = 1
    written: str | None = None


class Entry(NamedTuple):
    """A key's place and its value."""

    key: Span
    value: "Node"


@dataclass(slots=True)
class MappingNode:
    """Keys in the order of the file. `size` counts the values below, through aliases too."""

    span: Span
    entries: dict[str, Entry] = field(default_factory=dict)
    size: int = 1


@dataclass(slots=True)
class SequenceNode:
    """A list. `size` counts the values below, through aliases too."""

    span: Span
    items: "list[Node]" = field(default_factory=list)
    size: int = 1


Node: TypeAlias = ScalarNode | MappingNode | SequenceNode


@dataclass(slots=True)
class Document:
    """The tree of a file, or of several that are read together; `sources` by their index.

    `faulty` are the keys whose values are not known: nothing is said that rests on one. `variables` are those that were
    filled in, by their values, as the file writes them: problems are shown to more people than may know the values.
    """

    sources: Mapping[int, Source]
    root: Node
    faulty: frozenset[Path] = frozenset()
    variables: Mapping[str, str] = field(default_factory=dict)
    guesses: int = MOST_GUESSES

    def nearest(self, word: str, candidates: Iterable[str], *, likeness: float = LIKENESS) -> str | None:
        """Return the candidate most like `word`, or None; after MOST_GUESSES searches always None."""
        if not self.guesses:
            return None
        self.guesses -= 1
        return nearest(word, candidates, likeness=likeness)

    def did_you_mean(self, word: str, candidates: Iterable[str], *, likeness: float = LIKENESS) -> str:
        """Return `, did you mean ...?` for the nearest candidate, or nothing."""
        return or_nearest(self.nearest(word, candidates, likeness=likeness))

    def problem(
        self,
        path: Path,
        text: str,
        *,
        code: str,
        span: Span | None = None,
        severity: Severity = Severity.ERROR,
        subject: str = "",
    ) -> Problem:
        """Return a problem with the key or value at a path, shown at its value or at `span`.

        Values of variables in its text are replaced by the variables. Where a text quotes parts of a value, ask
        `filled_in` first.
        """
        span = span or self.value_span(path)
        return self.sources[span.source].problem(
            self._as_written(text),
            code=code,
            span=span,
            path=dotted(path),
            severity=severity,
            subject=self._as_written(subject),
        )

    def filled_in(self, path: Path) -> FilledIn | None:
        """Return what to show instead of a value that has variables; None if it has none."""
        node = self.find(path)
        written = node.written if isinstance(node, ScalarNode) else None
        return None if written is None else FilledIn(written)

    def _as_written(self, text: str) -> str:
        # Longest first, as one value may contain another.
        for value in sorted(self.variables, key=len, reverse=True):
            # Absolute names have lost a leading `~` or `/`.
            for part in (value, value.strip("~/")):
                for shown in (part, printable(part)):
                    text = without_value(text, shown, self.variables[value])
        return text

    def refuse_other_kind(self, key: str, *, own: str, text: str) -> None:
        """Raise ConfigError for a file of another kind: it has this key and not the one of its own kind."""
        if self.has((key,)) and not self.has((own,)):
            raise ConfigError([self.problem((key,), text, code="other_kind", span=self.key_span((key,)))])

    def line(self, path: Path, *, beside: Path) -> str:
        """Return `line 7`, where a value is, for a sentence about the value `beside` it; with its file if that differs.

        Both may stand at one place, in a block that is written once.
        """
        span, shown = self.value_span(path), self.value_span(beside)
        if span == shown and path != beside:
            return f"line {span.line}, which an alias or `<<` repeats"
        is_elsewhere = span.source != shown.source
        return f"line {span.line}{f' of {printable(self.sources[span.source].name)}' if is_elsewhere else ''}"

    def has(self, path: Path) -> bool:
        """Tell whether something is written at a path."""
        return self.find(path) is not None

    def key_span(self, path: Path) -> Span:
        """Return where the last key of a path stands; for a list item, the item."""
        if not path:
            return self.root.span
        *parents, last = path
        parent = self.node(tuple(parents))
        if isinstance(parent, MappingNode) and isinstance(last, str) and last in parent.entries:
            return parent.entries[last].key
        return self.node(path).span

    def value_span(self, path: Path) -> Span:
        """Return where the value of a path stands."""
        return self.node(path).span

    def find(self, path: Path) -> Node | None:
        """Return the node at a path, or None."""
        node: Node | None = self.root
        for step in path:
            node = _step(node, step) if node is not None else None
        return node

    def node(self, path: Path) -> Node:
        """Return the node at a path, or the deepest above it that exists."""
        node = self.root
        for step in path:
            below = _step(node, step)
            if below is None:
                break
            node = below
        return node


def flow(value: Any) -> str:
    """Return a plain value as YAML on one line, without keys that begin with EXTENSION."""
    match value:
        case dict():
            known = {key: each for key, each in value.items() if not key.startswith(EXTENSION)}
            return "{" + ", ".join(f"{key}: {flow(each)}" for key, each in known.items()) + "}"
        case tuple():
            return "[" + ", ".join(map(flow, value)) + "]"
        case bool():
            return "true" if value else "false"
        case None:
            return "null"
        case _:
            return printable(str(value)) or '""'


def as_written(node: Node) -> Any:
    """Return the tree as `plain` does, but with `${NAME}` as written."""
    return plain(node, of_scalar=lambda scalar: scalar.value if scalar.written is None else scalar.written)


def _step(node: Node, step: str | int) -> Node | None:
    match node:
        case MappingNode():
            entry = node.entries.get(str(step))
            return entry.value if entry else None
        case SequenceNode() if isinstance(step, int) and step < len(node.items):
            return node.items[step]
        case _:
            return None


def plain(node: Node, *, of_scalar: Callable[[ScalarNode], Scalar] = lambda scalar: scalar.value) -> Any:
    """Return the tree as dicts, tuples and scalars."""
    match node:
        case ScalarNode():
            return of_scalar(node)
        case SequenceNode():
            return tuple(plain(item, of_scalar=of_scalar) for item in node.items)
        case MappingNode():
            return {key: plain(entry.value, of_scalar=of_scalar) for key, entry in node.entries.items()}
