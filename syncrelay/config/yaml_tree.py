"""From a text to a Document: PyYAML composes the nodes, and here they become keys and values with their places.

The rest of PyYAML's loader is left out, because it keeps the last of two equal keys in silence, reads YAML 1.1 scalars
and builds an alias bomb before anyone can object.
"""

from collections.abc import Mapping
from typing import Any, Final

import yaml
from yaml.composer import Composer
from yaml.resolver import BaseResolver

from syncrelay.config.document import (
    MOST_VALUES,
    Document,
    Entry,
    MappingNode,
    Node,
    Scalar,
    ScalarNode,
    SequenceNode,
    plain,
)
from syncrelay.config.problems import ConfigError, Path, Problem, Span, dotted
from syncrelay.config.scalars import read_plain, substitute, variables_in
from syncrelay.config.source import Source
from syncrelay.config.wording import FilledIn, describe, quoted
from syncrelay.config.yaml_errors import DEEPEST, TOO_DEEP, in_words

LOADER: Final = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
MOST_PROBLEMS: Final = 1_000
"""Of a file with single keys and values, which may be at the end of a long path."""
# Longer than any ROS name. Every problem below a key repeats the key, so its length is limited.
_LONGEST_KEY: Final = 255
# A text of so many characters counts as one value more.
_CHARACTERS: Final = 100

_PLAIN, _OTHER = "plain", "other"

# https://yaml.org/type/merge.html: not of YAML 1.2, but editors and Compose read it.
_MERGE: Final = "<<"


def compose(source: Source, environ: Mapping[str, str], *, expected: str) -> tuple[Document, list[Problem]]:
    """Return the tree of a file and what is wrong with single keys and values of it.

    Raises ConfigError where no tree can be made; of an empty file it says what was expected.
    """
    tree = _Tree(source, environ)
    try:
        composed = _Composer(source).compose_file()
    except yaml.MarkedYAMLError as error:
        text, span = in_words(error, source.lines)
        raise ConfigError([source.problem(text, span=span, code="yaml")]) from error
    root = None if composed is None else tree.node(composed, ())
    if root is None or (isinstance(root, ScalarNode) and root.value is None):
        raise ConfigError([source.problem(f"the file is empty, expected {expected}", span=None, code="empty")])
    return Document({source.index: source}, root, variables=tree.variables), tree.problems


class _Composer(Composer, BaseResolver):
    """PyYAML's composer on the events of its parser, within bounds that no real file meets.

    Of aliases only the events tell where they stand, so what is refused of them is refused here.
    """

    def __init__(self, source: Source) -> None:
        Composer.__init__(self)
        BaseResolver.__init__(self)
        parser = LOADER(source.text)
        self.check_event, self.peek_event, self.get_event = parser.check_event, parser.peek_event, parser.get_event
        self._source = source
        self._depth = 0
        # The values so far, counted through aliases too, and those below each anchor; None while it is open.
        self._values = 0
        self._below: dict[str, int | None] = {}

    def compose_file(self) -> yaml.Node | None:
        self.get_event()
        root = None if self.check_event(yaml.StreamEndEvent) else self.compose_document()
        if not self.check_event(yaml.StreamEndEvent):
            raise self._refusal("a second document begins here, expected one per file", self.peek_event())
        return root

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        event = self.peek_event()
        is_key = isinstance(parent, yaml.MappingNode) and index is None
        self._check(event, is_key=is_key)
        if isinstance(event, yaml.AliasEvent):
            return super().compose_node(parent, index)
        before, anchor = self._values, event.anchor
        if anchor is not None:
            # Of two anchors of one name, an alias means the one above it.
            self.anchors.pop(anchor, None)
            self._below[anchor] = None
        if not is_key:
            self._values += _size(event.value) if isinstance(event, yaml.ScalarEvent) else 1
        self._depth += 1
        node = super().compose_node(parent, index)
        self._depth -= 1
        if anchor is not None:
            self._below[anchor] = self._values - before
        return node

    def resolve(self, kind: type[yaml.Node], _value: Any, implicit: Any) -> str:
        """Return the tag of a node for which the file has none."""
        return _PLAIN if kind is yaml.ScalarNode and implicit[0] else _OTHER

    def _check(self, event: Any, *, is_key: bool) -> None:
        match event:
            case yaml.AliasEvent():
                self._check_alias(event, is_key=is_key)
            case _ if event.tag is not None:
                written = event.tag.replace("tag:yaml.org,2002:", "!!")
                raise self._refusal(f"tags such as {quoted(written)} are not supported", event)
            case yaml.CollectionStartEvent() if is_key:
                what = "mapping" if isinstance(event, yaml.MappingStartEvent) else "list"
                raise self._refusal(f"a {what} cannot be a key: put text that begins with a bracket in quotes", event)
            case yaml.CollectionStartEvent() if self._depth == DEEPEST:
                raise self._refusal(TOO_DEEP, event)
            case yaml.ScalarEvent() if is_key and len(event.value) > _LONGEST_KEY:
                text = f"a key of {len(event.value)} characters, at most {_LONGEST_KEY} are allowed"
                raise self._refusal(text, event)

    def _check_alias(self, event: yaml.AliasEvent, *, is_key: bool) -> None:
        alias, anchor = quoted(f"*{event.anchor}"), str(event.anchor)
        below = self._below.get(anchor, 0)
        if below is None:
            raise self._refusal(f"{alias} refers to a block that contains it", event)
        if anchor not in self._below:
            raise self._refusal(f"{alias} has no anchor: there is no `&{anchor}` above", event)
        if is_key:
            raise self._refusal("an alias cannot be a key", event)
        self._values += below
        if self._values > MOST_VALUES:
            raise self._refusal(f"with all aliases expanded the file has more than {MOST_VALUES} values", event)

    def _refusal(self, text: str, event: Any) -> ConfigError:
        return ConfigError([self._source.problem(text, span=_span(event, self._source), code="yaml")])


def _span(at: Any, source: Source) -> Span:
    """Return where an event or a node stands: a scalar or a bracket within its line, else the rest of the line."""
    start, end = at.start_mark, at.end_mark
    is_open = isinstance(at, yaml.CollectionStartEvent) or (isinstance(at, yaml.CollectionNode) and not at.flow_style)
    width = 0 if is_open or end.line != start.line else end.column - start.column
    if width < 1:
        width = len(source.line(start.line + 1)) - start.column
    return Span(start.line + 1, start.column + 1, max(1, width), source.index)


class _Tree:
    """Makes the tree of a file from PyYAML's nodes, and notes what is wrong with single keys and values."""

    def __init__(self, source: Source, environ: Mapping[str, str]) -> None:
        self.problems: list[Problem] = []
        self.variables: dict[str, str] = {}
        self._source = source
        self._environ = environ
        # What an anchor stands for is one node, however many aliases mean it.
        self._made: dict[int, Node] = {}

    def node(self, node: yaml.Node, path: Path, *, key: Span | None = None) -> Node:
        """Return what a node of PyYAML's says; of an empty value its key is what can be shown."""
        if id(node) not in self._made:
            span = _span(node, self._source)
            match node:
                case yaml.MappingNode():
                    self._made[id(node)] = self._mapping(node, span, path)
                case yaml.SequenceNode():
                    items = [self.node(item, (*path, index)) for index, item in enumerate(node.value)]
                    self._made[id(node)] = SequenceNode(span, items, 1 + sum(item.size for item in items))
                case yaml.ScalarNode():
                    self._made[id(node)] = self._scalar(node, (key if not node.value else None) or span, path)
        return self._made[id(node)]

    def _mapping(self, node: yaml.MappingNode, span: Span, path: Path) -> MappingNode:
        own: dict[str, Entry] = {}
        merged: dict[str, Entry] = {}
        merge: Span | None = None
        size = 1
        for key, value in node.value:
            at, name = _span(key, self._source), str(key.value)
            is_merging = name == _MERGE and key.tag == _PLAIN
            if is_merging and merge is not None:
                text = f"`<<` is also on line {merge.line}: write one with a list, `<<: [*one, *other]`"
                self._report(text, at, (*path, name), code="duplicate_key")
            elif not is_merging and name in own:
                text = f"duplicate key, first on line {own[name].key.line}"
                self._report(text, at, (*path, name), code="duplicate_key")
            below = self.node(value, (*path, name), key=at)
            size += below.size
            if is_merging:
                merge = merge or at
                self._merge(below, merged, at, (*path, name))
            else:
                own.setdefault(name, Entry(at, below))
        # Its own first: where a mapping as a whole is meant, its first key is shown.
        return MappingNode(span, own | {name: entry for name, entry in merged.items() if name not in own}, size)

    def _merge(self, node: Node, merged: dict[str, Entry], at: Span, path: Path) -> None:
        """Note the entries of a mapping, or of a list of them; of two with one key, that of the first counts."""
        for source in node.items if isinstance(node, SequenceNode) else [node]:
            if isinstance(source, MappingNode):
                merged |= {key: entry for key, entry in source.entries.items() if key not in merged}
            elif not isinstance(source, ScalarNode) or source.readable:
                written = source.written if isinstance(source, ScalarNode) else None
                found = plain(source) if written is None else FilledIn(written)
                text = f"expected a mapping such as `*name`, or a list of mappings, found {describe(found)}"
                self._report(text, at, path, code="merge_key")

    def _scalar(self, node: yaml.ScalarNode, span: Span, path: Path) -> ScalarNode:
        written: str = node.value
        if "$" not in written:
            value = read_plain(written) if node.tag == _PLAIN else written
            return ScalarNode(span, value, size=_size(value))
        self.variables |= variables_in(written, self._environ)
        try:
            text = substitute(written, self._environ)
        except ValueError as error:
            self._report(str(error), span, path, code="substitution")
            return ScalarNode(span, None, readable=False)
        # Read as if it stood there unquoted: within braces a variable has no other way to be a number.
        value = read_plain(text) if text else ""
        return ScalarNode(span, value, size=_size(value), written=written)

    def _report(self, text: str, span: Span, path: Path, *, code: str) -> None:
        if len(self.problems) == MOST_PROBLEMS:
            raise ConfigError([*self.problems, too_many(self._source, span)])
        self.problems.append(self._source.problem(text, path=dotted(path), span=span, code=code))


def _size(value: Scalar) -> int:
    return 1 + (len(value) // _CHARACTERS if isinstance(value, str) else 0)


def too_many(source: Source, span: Span | None) -> Problem:
    """Return what is said of a file, at the place of its last problem that is told."""
    return source.problem("too many errors: the file was not read beyond this line", span=span, code="yaml")
