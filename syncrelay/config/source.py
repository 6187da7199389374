"""The text of a file, or the reason why it can't be one."""

import os
import re
import select
import stat
import sys
import time
from dataclasses import dataclass
from io import FileIO
from pathlib import Path
from typing import Final

from syncrelay.config.problems import ConfigError, Problem, Severity, Span
from syncrelay.config.wording import nearest
from syncrelay.yaml_files import MOST_FILES, files_of

STDIN: Final = "-"
# A file of a thousand groups with four topics each is half as large.
_MOST_BYTES: Final = 1_000_000
_MOST_LINES: Final = 50_000
PATIENCE_S: Final = 10.0
"""How long a pipe may take to end, such as `<(...)` or a FIFO that nobody writes to."""

_NO_FILES: Final = {
    stat.S_IFDIR: "directory",
    stat.S_IFCHR: "device",
    stat.S_IFBLK: "device",
    stat.S_IFSOCK: "socket",
}
# The line breaks of YAML 1.1, which PyYAML counts by.
_BREAK = re.compile("\r\n|[\r\n\x85\u2028\u2029]")
# What YAML does not allow in a file (YAML 1.2, 5.1, which lists the others: a set of those takes long to compile).
_UNPRINTABLE = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x84\x86-\x9f\ud800-\udfff\ufffe\uffff]")


@dataclass(frozen=True, slots=True)
class Source:
    """A file's name as the user gave it, its text and its lines; `index` is its place among files read together."""

    name: str
    text: str
    lines: tuple[str, ...]
    index: int = 0

    def line(self, number: int) -> str:
        """Return a line by its number from 1; the line behind the last is empty."""
        return self.lines[number - 1] if number <= len(self.lines) else ""

    def problem(
        self,
        text: str,
        *,
        code: str,
        span: Span | None,
        path: str = "",
        severity: Severity = Severity.ERROR,
        subject: str = "",
    ) -> Problem:
        """Return a problem of this file."""
        return Problem(self.name, path, text, code, span, self.line(span.line) if span else "", severity, subject)


def shown_name(path: str) -> str:
    """Return a file's name as problems show it."""
    return "<stdin>" if path == STDIN else path or "''"


def read_source(path: str, *, patience_s: float = PATIENCE_S, since: float | None = None) -> Source:
    """Return the text of a file, `-` for standard input, which alone is waited for without end.

    A pipe is waited for so many seconds, counted from `since` on the monotonic clock, by default from now. Raises
    ConfigError where there is no text.
    """
    until = (time.monotonic() if since is None else since) + patience_s
    if path == STDIN:
        return decode(sys.stdin.buffer.read(_MOST_BYTES + 1), name=shown_name(path))
    if not path:
        raise _unreadable(shown_name(path), "is not a file name")
    try:
        content = _content(path, until=until)
    except TimeoutError as error:
        late = f"could not be read to its end within {patience_s:g} s"
        raise _unreadable(path, f"{late}: is it a pipe that nobody writes to, or closes?") from error
    except FileNotFoundError as error:
        raise _unreadable(path, f"no such file{_similar_file(Path(path))}") from error
    except OSError as error:
        raise _unreadable(path, f"cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise _unreadable(path, "is not a file name") from error
    return decode(content, name=path)


def _content(path: str, *, until: float) -> bytes:
    """Return a file's bytes, at most one more than allowed. Raises TimeoutError for a pipe that does not end."""
    kind = _NO_FILES.get(stat.S_IFMT(Path(path).stat().st_mode))
    if kind == "directory" and len(files := files_of(path)) > MOST_FILES:
        raise _unreadable(path, f"more than {MOST_FILES} YAML files: is this the right directory?")
    if kind == "directory" and not files:
        raise _unreadable(path, "no *.yaml or *.yml file in this directory")
    if kind is not None:
        # Opening a device may have side effects.
        raise _unreadable(path, f"is a {kind}, expected a YAML file")
    # A blocking open of a FIFO waits for a writer, without a limit.
    with FileIO(path, opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)) as file:
        return _read(file, until=until)


def _read(file: FileIO, *, until: float) -> bytes:
    waiting = select.poll()
    waiting.register(file, select.POLLIN)
    content = bytearray()
    while len(content) <= _MOST_BYTES:
        if not waiting.poll(max(0.0, until - time.monotonic()) * 1000):
            raise TimeoutError
        chunk = file.read(_MOST_BYTES + 1 - len(content))
        if chunk == b"":
            break
        # None if another reader took the bytes.
        content += chunk or b""
    return bytes(content)


def decode(content: bytes, *, name: str) -> Source:
    """Return the source that bytes hold; raises ConfigError if they are no text or too much of it."""
    if len(content) > _MOST_BYTES:
        raise _unreadable(name, f"larger than {_MOST_BYTES // 1_000_000} MB: is this the right file?")
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
        raise _unreadable(name, f"more than {_MOST_LINES} lines: is this the right file?")
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


def _similar_file(path: Path) -> str:
    """Return a question for the YAML file beside a path whose name is most like it."""
    try:
        others = (file for file in path.parent.iterdir() if file != path)
        by_stem = {file.stem: file for file in others if file.suffix in (".yaml", ".yml")}
    except OSError:
        return ""
    stem = nearest(path.stem, by_stem)
    return f", did you mean `{by_stem[stem]}`?" if stem else ""


def _unreadable(name: str, text: str) -> ConfigError:
    return ConfigError([Problem(name, "", text, "unreadable")])
