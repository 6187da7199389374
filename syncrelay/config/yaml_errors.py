"""PyYAML's syntax errors in plain words: it names a grammar rule, we name the mistake.

What people meet most has sentences of ours: a tab, a colon or its space, indentation, a bracket, a quote. The rest is
told in PyYAML's.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import yaml

from syncrelay.config.problems import Span
from syncrelay.config.wording import one_of, quoted

# `key:value`, with or without a dash, where a space belongs behind the colon. Not a time, a URL or C++ name.
_NO_SPACE_AFTER_COLON = re.compile(r"(?:- )?\s*[A-Za-z_]\w*:(?![\s/:]|$)\S")
_NO_SPACE_AFTER_DASH = re.compile(r"-[A-Za-z_]")
_WORD = re.compile(r"[^\s,:\[\]{}]+|\S")

# A file that uses every key is 7 levels deep.
DEEPEST: Final = 50
TOO_DEEP: Final = f"more than {DEEPEST} levels of nesting"

Fault: TypeAlias = tuple[str, Span]


@dataclass(frozen=True, slots=True)
class _Scene:
    """Where PyYAML stopped, and where the construct that it was reading began. Rows and columns count from 0."""

    lines: tuple[str, ...]
    jargon: str
    row: int
    column: int
    start_row: int
    start_column: int

    @property
    def line(self) -> str:
        return self.text(self.row)

    @property
    def before(self) -> str:
        """The line up to where it stopped."""
        return self.line[: self.column]

    @property
    def found(self) -> str:
        """The word where it stopped, empty at the end of a line."""
        word = _WORD.match(self.line, self.column)
        return word.group() if word else ""

    def text(self, row: int) -> str:
        return self.lines[row] if row < len(self.lines) else ""

    def here(self) -> Span:
        return Span(self.row + 1, self.column + 1, max(1, len(self.found)))

    def start(self, width: int = 1) -> Span:
        return Span(self.start_row + 1, self.start_column + 1, width)

    def content(self, row: int) -> Span:
        """Return a line without its indentation."""
        text = self.text(row)
        indent = _indent(text)
        return Span(row + 1, indent + 1, max(1, len(text.rstrip()) - indent))

    def row_above(self) -> int | None:
        """Return the nearest line above with more than a comment."""
        for row in range(min(self.row, len(self.lines)) - 1, -1, -1):
            if self.lines[row].strip() and not self.lines[row].lstrip().startswith("#"):
                return row
        return None


def in_words(error: yaml.MarkedYAMLError, lines: tuple[str, ...]) -> Fault:
    """Return what is wrong with the syntax of a file, and where."""
    mark: Any = error.problem_mark or error.context_mark
    start: Any = error.context_mark or mark
    scene = _Scene(lines, str(error.problem), mark.line, mark.column, start.line, start.column)
    tab_at = scene.line.find("\t", 0, scene.column + 1)
    if tab_at >= 0 and not scene.line[:tab_at].strip("- "):
        return "a tab in the indentation, expected spaces", Span(scene.row + 1, tab_at + 1, 1)
    say = next((say for jargon, say in _SAYINGS if jargon in scene.jargon), None)
    said = say(scene) if say is not None else None
    if said is not None:
        return said
    context = f", {error.context}" if error.context else ""
    return f"this is not valid YAML: {scene.jargon}{context}", scene.here()


def _second_colon(scene: _Scene) -> Fault | None:
    """`mapping values are not allowed`: a colon where no key can be."""
    above = scene.row_above()
    if ": " in scene.before:
        value_at = scene.before.index(": ") + 2
        value = Span(scene.row + 1, value_at + 1, max(1, len(scene.line.rstrip()) - value_at))
        return "a second `: ` in one line: if it belongs to the value, put the value in quotes", value
    if above is None:
        return None
    text = scene.text(above).strip()
    if _NO_SPACE_AFTER_COLON.match(text):
        return _SPACE_AFTER_COLON, scene.content(above)
    if _NO_SPACE_AFTER_DASH.match(text):
        return "expected a space after `-`", scene.content(above)
    if _indent(scene.line) > _indent(scene.text(above)):
        return "indented deeper than the line above, which has a value already", scene.content(scene.row)
    return None


_SPACE_AFTER_COLON: Final = "expected `key: value`, with a space after the colon"


def _no_colon(scene: _Scene) -> Fault:
    """`could not find expected ':'`: a line that is neither key nor value."""
    content = scene.content(scene.start_row)
    if _NO_SPACE_AFTER_COLON.match(scene.text(scene.start_row).strip()):
        return _SPACE_AFTER_COLON, content
    return "expected `key: value`, found no colon", content


def _not_here(scene: _Scene) -> Fault | None:
    """`did not find expected key` or '-': the indentation is off, or something follows a whole value."""
    if scene.before.strip():
        return "text after the end of a value: put the whole value in quotes", scene.here()
    levels = _open_levels(scene)
    if not levels:
        return None
    content = scene.content(scene.row)
    if scene.column not in levels:
        below = [level for level in levels if level < scene.column][:1]
        above = [level for level in levels if level > scene.column][-1:]
        spaces = "1 space" if scene.column == 1 else f"{scene.column} spaces"
        return f"indented by {spaces}, expected {one_of(map(str, below + above))} as above", content
    if scene.line[scene.column :].startswith("-"):
        return "a list item (`- `) where a key belongs", content
    of_item = [level for level in levels if level > scene.column][-1:]
    hint = f"; indented by {of_item[0]} it belongs to the item above" if of_item else ""
    return f"a key where a list item (`- `) belongs{hint}", content


def _open_levels(scene: _Scene) -> list[int]:
    """Return the indentations of the blocks that a line could go on with, the deepest first."""
    levels: list[int] = []
    lowest = len(scene.line) + 1_000_000
    for row in range(min(scene.row, len(scene.lines)) - 1, -1, -1):
        text = scene.lines[row]
        if not text.strip() or text.lstrip().startswith("#"):
            continue
        levels.extend(level for level in _levels(text) if level < lowest)
        lowest = min(lowest, _indent(text))
        if lowest == 0:
            break
    return levels


def _levels(text: str) -> list[int]:
    """Return a line's indentation and, behind a dash, that of the key there; the deeper first."""
    indent = _indent(text)
    if not text[indent:].startswith("- "):
        return [indent]
    return [indent + 1 + _indent(text[indent + 1 :]), indent]


def _open_bracket(scene: _Scene) -> Fault:
    """`expected ',' or ']'` in a flow list or mapping."""
    if scene.before.rstrip().endswith("$") and scene.found == "{":
        return 'within braces or brackets a variable needs quotes: "${NAME}"', scene.here()
    closing = "]" if "]" in scene.jargon else "}"
    if scene.row > scene.start_row or not scene.found:
        return f"the bracket is never closed, expected `{closing}`", scene.start()
    if scene.found == ":":
        return f"expected `,` or `{closing}` before this key", _word_before(scene)
    return f"expected `,` or `{closing}`, found {quoted(scene.found)}", scene.here()


def _word_before(scene: _Scene) -> Span:
    words = list(_WORD.finditer(scene.before))
    return Span(scene.row + 1, words[-1].start() + 1, len(words[-1].group())) if words else scene.here()


def _open_quote(scene: _Scene) -> Fault:
    return "the quote is never closed", scene.start()


def _no_content(scene: _Scene) -> Fault | None:
    """`node content`: what is wrong is plain where the file ends there."""
    return (
        None if scene.found else ("expected a value, found the end of the file: is a bracket not closed?", scene.here())
    )


_SAYINGS: Final[tuple[tuple[str, Callable[[_Scene], Fault | None]], ...]] = (
    ("mapping values are not allowed", _second_colon),
    ("could not find expected ':'", _no_colon),
    ("did not find expected key", _not_here),
    ("did not find expected '-' indicator", _not_here),
    ("expected <block end>", _not_here),
    ("expected ',' or", _open_bracket),
    ("unexpected end of stream", _open_quote),
    ("document separator", _open_quote),
    ("node content", _no_content),
    # libyaml's own limit: it reads up to 1,024 characters ahead, so it may be there before we are at ours.
    ("maximum nesting depth", lambda scene: (TOO_DEEP, scene.here())),
)


def _indent(text: str) -> int:
    return len(text) - len(text.lstrip(" "))
