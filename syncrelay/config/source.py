"""The text of a file, or the reason why it can't be one."""

import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from syncrelay.config.errors import ConfigError
from syncrelay.config.problems import Problem, Span
from syncrelay.config.wording import nearest

STDIN: Final = "-"
# A thousand groups of four topics are half of it.
_MOST_BYTES: Final = 1_000_000
_MOST_LINES: Final = 50_000
# The line breaks of YAML 1.1, which PyYAML counts by.
_BREAK = re.compile("\r\n|[\r\n\x85\u2028\u2029]")
# What YAML does not allow in a file (YAML 1.2, 5.1).
_UNPRINTABLE = re.compile("[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


@dataclass(frozen=True, slots=True)
class Source:
    """A file's name as the user gave it, its text and its lines."""

    name: str
    text: str
    lines: tuple[str, ...]

    def line(self, number: int) -> str:
        """Return a line by its number from 1; the line behind the last is empty."""
        return self.lines[number - 1] if number <= len(self.lines) else ""

    def problem(self, text: str, *, code: str, span: Span | None, path: str = "") -> Problem:
        """Return a problem of this file."""
        return Problem(self.name, path, text, code, span, self.line(span.line) if span else "")


def read_source(path: str) -> Source:
    """Return the text of a file, `-` for standard input; raises ConfigError where it has none."""
    if path == STDIN:
        return decode(sys.stdin.buffer.read(_MOST_BYTES + 1), name="<stdin>")
    if not path:
        raise _unreadable("''", "is no file name")
    try:
        with Path(path).open("rb") as file:
            content = file.read(_MOST_BYTES + 1)
    except OSError as error:
        raise _unreadable(path, _reason(path, error)) from error
    except ValueError as error:
        raise _unreadable(path, "is no file name") from error
    return decode(content, name=path)


def decode(content: bytes, *, name: str) -> Source:
    """Return the source that bytes hold; raises ConfigError if they are no text or too much of it."""
    if len(content) > _MOST_BYTES:
        raise _unreadable(name, f"over {_MOST_BYTES // 1_000_000} MB, is this the right file?")
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise _unreadable(name, "the text is UTF-16, expected UTF-8")
    try:
        return check_text(_without_mark(content.decode()), name=name)
    except UnicodeDecodeError as error:
        readable = Source(name, "", _lines(_without_mark(content.decode("utf-8", "replace"))))
        span = _span_at(_without_mark(content[: error.start].decode()))
        text = f"byte 0x{content[error.start]:02x} at offset {error.start} is not UTF-8"
        raise ConfigError([readable.problem(text, code="encoding", span=span)]) from error


def check_text(text: str, *, name: str) -> Source:
    """Return the source of a text; raises ConfigError for characters that YAML has no place for."""
    source = Source(name, text, _lines(text))
    if len(source.lines) > _MOST_LINES:
        raise _unreadable(name, f"over {_MOST_LINES} lines, is this the right file?")
    found = _UNPRINTABLE.search(text)
    if found is not None:
        span = _span_at(text[: found.start()])
        refusal = f"the character U+{ord(found.group()):04X} is not allowed in YAML"
        raise ConfigError([source.problem(refusal, code="encoding", span=span)])
    return source


def _without_mark(text: str) -> str:
    """Return a text without the byte order mark that some editors put first."""
    return text.removeprefix("\ufeff")


def _lines(text: str) -> tuple[str, ...]:
    return tuple(_BREAK.split(text))


def _span_at(before: str) -> Span:
    lines = _lines(before)
    return Span(len(lines), len(lines[-1]) + 1, 1)


def _reason(path: str, error: OSError) -> str:
    match error:
        case FileNotFoundError():
            return f"no such file{_similar_file(Path(path))}"
        case IsADirectoryError():
            return "is a directory, expected a YAML file"
        case _:
            return f"cannot be read: {error.strerror}"


def _similar_file(path: Path) -> str:
    """Return a question for the YAML file beside a path whose name is most like it."""
    try:
        by_stem = {file.stem: file for file in path.parent.iterdir() if file.suffix in (".yaml", ".yml")}
    except OSError:
        return ""
    stem = nearest(path.stem, by_stem)
    return f", did you mean `{by_stem[stem]}`?" if stem else ""


def _unreadable(name: str, text: str) -> ConfigError:
    return ConfigError([Problem(name, "", text, "unreadable")])
