"""From YAML's events to a Document, in one pass without recursion, within bounds that no real file meets.

On PyYAML's events and not its loader, because the loader keeps the last of two equal keys in silence, reads YAML
1.1 scalars, recurses once per level and builds an alias bomb before anyone can object.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import yaml

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
from syncrelay.config.source import Source
from syncrelay.config.wording import FilledIn, describe, quoted
from syncrelay.config.yaml_errors import DEEPEST, TOO_DEEP, in_words

LOADER: Final = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
MOST_PROBLEMS: Final = 1_000
"""Of a file with single keys and values, which may be at the end of a long path."""
# No name of ROS is as long, and every problem below a key tells the key.
_LONGEST_KEY: Final = 255
# A text of so many characters counts as one value more.
_CHARACTERS: Final = 100

# YAML 1.2's core schema (10.3.2), so that editors and syncrelay agree.
_CONSTANTS: Final[dict[str, Scalar]] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **dict.fromkeys((".nan", ".NaN", ".NAN"), float("nan")),
    **{sign + word: float(sign + "inf") for sign in ("", "+", "-") for word in (".inf", ".Inf", ".INF")},
}
_DECIMAL = re.compile(r"[-+]?[0-9]+")
_OCTAL_OR_HEXADECIMAL = re.compile(r"0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?")
# Python refuses to read longer ones, and no key has a use for them.
_LONGEST_NUMBER = 400

# https://yaml.org/type/merge.html: not of YAML 1.2, but editors and Compose read it.
_MERGE: Final = "<<"

_DOLLAR = re.compile(
    r"\$(?:(?P<escaped>\$)|\{(?P<name>[A-Za-z_]\w*)(?P<default>:-[^{}$]*)?\}|(?P<other>\{[^}]*\}?|\w*))"
)


def compose(source: Source, environ: Mapping[str, str], *, expected: str) -> tuple[Document, list[Problem]]:
    """Return the tree of a file and what is wrong with single keys and values of it.

    Raises ConfigError where no tree can be made; of an empty file it says what was expected.
    """
    composer = _Composer(source, environ)
    try:
        for event in yaml.parse(source.text, Loader=LOADER):
            composer.take(event)
    except yaml.MarkedYAMLError as error:
        text, span = in_words(error, source.lines)
        raise ConfigError([source.problem(text, span=span, code="yaml")]) from error
    if composer.root is None or (isinstance(composer.root, ScalarNode) and composer.root.value is None):
        raise ConfigError([source.problem(f"the file is empty, expected {expected}", span=None, code="empty")])
    return Document({source.index: source}, composer.root, variables=composer.variables), composer.problems


@dataclass(slots=True)
class _Open:
    """A mapping or list whose end has not come yet. `key` is a mapping's key that waits for its value.

    `merged` are the entries that a mapping has from others, where it does not have them itself; `merge` is the key that
    says so, `is_merging` while that waits for its value.
    """

    node: MappingNode | SequenceNode
    anchor: str | None
    step: str | int = 0
    key: Span | None = None
    merge: Span | None = None
    is_merging: bool = False
    merged: dict[str, Entry] = field(default_factory=dict)


class _Composer:
    def __init__(self, source: Source, environ: Mapping[str, str]) -> None:
        self.root: Node | None = None
        self.problems: list[Problem] = []
        self.variables: dict[str, str] = {}
        self._source = source
        self._environ = environ
        self._open: list[_Open] = []
        self._anchors: dict[str, Node] = {}

    def take(self, event: yaml.Event) -> None:
        match event:
            case yaml.DocumentStartEvent() if self.root is not None:
                raise self._refusal("a second document begins here, expected one per file", self._span(event))
            case yaml.ScalarEvent():
                self._scalar(event)
            case yaml.AliasEvent():
                self._alias(event)
            case yaml.MappingStartEvent():
                self._begin(MappingNode(self._span(event)), event)
            case yaml.SequenceStartEvent():
                self._begin(SequenceNode(self._span(event)), event)
            case yaml.MappingEndEvent() | yaml.SequenceEndEvent():
                self._end(event)

    def _begin(self, node: MappingNode | SequenceNode, event: Any) -> None:
        self._check_tag(event)
        if self._awaits_key():
            what = "mapping" if isinstance(node, MappingNode) else "list"
            raise self._refusal(f"a {what} cannot be a key: put text that begins with a bracket in quotes", node.span)
        if len(self._open) == DEEPEST:
            raise self._refusal(TOO_DEEP, node.span)
        self._open.append(_Open(node, event.anchor))

    def _end(self, event: Any) -> None:
        ended = self._open.pop()
        closes_bracket = event.end_mark.column > event.start_mark.column
        if closes_bracket and event.end_mark.line == ended.node.span.line - 1:
            start = ended.node.span
            ended.node.span = start._replace(width=event.end_mark.column - start.column + 1)
        if isinstance(ended.node, MappingNode):
            # Behind its own: where a mapping as a whole is meant, its first key is shown.
            for key, entry in ended.merged.items():
                ended.node.entries.setdefault(key, entry)
        self._place(ended.node, ended.anchor)

    def _scalar(self, event: yaml.ScalarEvent) -> None:
        self._check_tag(event)
        span = self._span(event)
        if self._awaits_key():
            self._key(event.value, span, is_plain=event.implicit[0])
            return
        top = self._open[-1] if self._open else None
        if not event.value and top is not None and top.key is not None:
            # Nothing stands there: its key is what can be shown.
            span = top.key
        self._place(self._value(event, span), event.anchor)

    def _key(self, key: str, span: Span, *, is_plain: bool) -> None:
        if len(key) > _LONGEST_KEY:
            raise self._refusal(f"a key of {len(key)} characters, at most {_LONGEST_KEY} are allowed", span)
        top = self._open[-1]
        top.step, top.key = key, span
        assert isinstance(top.node, MappingNode)  # noqa: S101  only a mapping awaits a key
        top.is_merging = key == _MERGE and is_plain
        if top.is_merging:
            if top.merge is not None:
                text = f"`<<` is also on line {top.merge.line}: write one with a list, `<<: [*one, *other]`"
                self._report(text, span, code="duplicate_key")
            top.merge = top.merge or span
        elif key in top.node.entries:
            first = top.node.entries[key].key.line
            self._report(f"duplicate key, first on line {first}", span, code="duplicate_key")

    def _value(self, event: yaml.ScalarEvent, span: Span) -> ScalarNode:
        try:
            value = self._resolved(event)
            size = 1 + (len(value) // _CHARACTERS if isinstance(value, str) else 0)
            return ScalarNode(span, value, size=size, written=event.value if "$" in event.value else None)
        except ValueError as error:
            self._report(str(error), span, code="substitution")
            return ScalarNode(span, None, readable=False)

    def _resolved(self, event: yaml.ScalarEvent) -> Scalar:
        written: str = event.value
        if "$" in written:
            # Read as if it stood there unquoted: within braces a variable has no other way to be a number.
            self.variables |= variables_in(written, self._environ)
            text = substitute(written, self._environ)
            return read_plain(text) if text else ""
        return read_plain(written) if event.implicit[0] else written

    def _alias(self, event: yaml.AliasEvent) -> None:
        span, name = self._span(event), str(event.anchor)
        if any(container.anchor == name for container in self._open):
            raise self._refusal(f"{quoted('*' + name)} refers to a block that contains it", span)
        target = self._anchors.get(name)
        if target is None:
            raise self._refusal(f"{quoted('*' + name)} has no anchor: there is no `&{name}` above", span)
        if self._awaits_key():
            raise self._refusal("an alias cannot be a key", span)
        self._place(target, None)
        if sum(container.node.size for container in self._open) > MOST_VALUES:
            raise self._refusal(f"with all aliases expanded the file has more than {MOST_VALUES} values", span)

    def _place(self, node: Node, anchor: str | None) -> None:
        if anchor:
            self._anchors[anchor] = node
        if not self._open:
            self.root = node
            return
        top = self._open[-1]
        top.node.size += node.size
        if isinstance(top.node, SequenceNode):
            top.node.items.append(node)
            top.step = len(top.node.items)
            return
        assert top.key is not None  # noqa: S101  a value follows its key
        if top.is_merging:
            self._merge(node, top, at=top.key)
        else:
            top.node.entries.setdefault(str(top.step), Entry(top.key, node))
        top.key = None

    def _merge(self, node: Node, top: _Open, *, at: Span) -> None:
        """Note the entries of a mapping, or of a list of them; of two with one key, that of the first counts."""
        for source in node.items if isinstance(node, SequenceNode) else [node]:
            if isinstance(source, MappingNode):
                for key, entry in source.entries.items():
                    top.merged.setdefault(key, entry)
            elif not isinstance(source, ScalarNode) or source.readable:
                written = source.written if isinstance(source, ScalarNode) else None
                found = plain(source) if written is None else FilledIn(written)
                text = f"expected a mapping such as `*name`, or a list of mappings, found {describe(found)}"
                self._report(text, at, code="merge_key")

    def _awaits_key(self) -> bool:
        return bool(self._open) and isinstance(self._open[-1].node, MappingNode) and self._open[-1].key is None

    def _check_tag(self, event: Any) -> None:
        if event.tag is not None:
            written = event.tag.replace("tag:yaml.org,2002:", "!!")
            raise self._refusal(f"tags such as {quoted(written)} are not supported", self._span(event))

    def _report(self, text: str, span: Span, *, code: str) -> None:
        if len(self.problems) == MOST_PROBLEMS:
            raise ConfigError([*self.problems, too_many(self._source, span)])
        self.problems.append(self._source.problem(text, path=dotted(self._path()), span=span, code=code))

    def _refusal(self, text: str, span: Span) -> ConfigError:
        return ConfigError([self._source.problem(text, span=span, code="yaml")])

    def _path(self) -> Path:
        return tuple(container.step for container in self._open)

    def _span(self, event: Any) -> Span:
        start, end = event.start_mark, event.end_mark
        width = end.column - start.column if end.line == start.line else 0
        if width < 1 or isinstance(event, yaml.CollectionStartEvent):
            width = len(self._source.line(start.line + 1)) - start.column
        return Span(start.line + 1, start.column + 1, max(1, width), self._source.index)


def too_many(source: Source, span: Span | None) -> Problem:
    """Return what is said of a file, at the place of its last problem that is told."""
    return source.problem("too many errors: the file was not read beyond this line", span=span, code="yaml")


def read_plain(text: str) -> Scalar:
    """Return the value of an unquoted scalar, as YAML 1.2 has it."""
    if text in _CONSTANTS:
        return _CONSTANTS[text]
    if len(text) > _LONGEST_NUMBER:
        return text
    if _DECIMAL.fullmatch(text):
        return int(text)
    if _OCTAL_OR_HEXADECIMAL.fullmatch(text):
        return int(text, 0)
    if _FLOAT.fullmatch(text):
        return float(text)
    return text


def substitute(text: str, environ: Mapping[str, str]) -> str:
    """Return the text with its variables filled in; `$$` is a dollar sign.

    A default stands for a variable that is unset or empty, as in a shell. Raises ValueError for an unset
    variable without a default and for what only looks like a variable.
    """
    return _DOLLAR.sub(lambda found: _value(found, environ), text)


def variables_in(text: str, environ: Mapping[str, str]) -> dict[str, str]:
    """Return the values that variables in a text have in the environment, each with what stands for it."""
    named = ((found["name"], found.group()) for found in _DOLLAR.finditer(text))
    return {environ[name]: written for name, written in named if name and environ.get(name)}


def _value(found: re.Match[str], environ: Mapping[str, str]) -> str:
    if found["escaped"]:
        return "$"
    name, default = found["name"], found["default"]
    if name is None:
        raise ValueError(
            f"{quoted(found.group())}: expected ${{NAME}} or ${{NAME:-default}}; write $$ for a dollar sign"
        )
    value = environ.get(name)
    if default is not None:
        return value or default.removeprefix(":-")
    if value is None:
        raise ValueError(f"the environment variable {name} is not set; write ${{{name}:-default}} to give it a default")
    return value
