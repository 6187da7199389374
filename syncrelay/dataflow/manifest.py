"""The manifest of each set: a diagnostic_msgs/msg/DiagnosticArray, written as CDR by hand.

docs/reference/manifest.md is its contract. Whatever is the same in every set of a group is serialized once.
"""

from collections.abc import Mapping, Sequence
from itertools import accumulate, chain
from operator import add
from struct import Struct
from typing import Final, NamedTuple

from syncrelay.cdr import read_stamp
from syncrelay.config import GroupConfig
from syncrelay.dataflow.backend import Content

MANIFEST_DEPTH: Final = 500
"""How many DDS keeps of a group: whoever joins sets needs each one, and a stall of some seconds must cost none."""

_VERSION: Final = 1

_NS_PER_SECOND: Final = 1_000_000_000
# As DiagnosticStatus has them.
_OK, _WARN, _ERROR, _STALE = range(4)
_COUNT: Final = Struct("<I").pack
# The encapsulation header of little-endian CDR, then the stamp.
_BEGIN: Final = Struct("<4BiI").pack
# Numbers of the same lengths become the same.
_ANY_DIGITS: Final = bytes.maketrans(b"0123456789", b"0000000000")
# Of a group there are some dozens, by the lengths of its numbers.
_MOST_TEMPLATES: Final = 500
# Why a message could not be published is told in DDS's words, this far.
_LONGEST: Final = 200


class Note(NamedTuple):
    """What the manifest of a set tells. Times in nanoseconds.

    `common` is the stamp that the set was given, if any. `missing` are the inputs of which it has no message. Each
    other input has four `values`: the stamp with which its message left, the one with which it came, when it was
    received, and which one of its output it is, from 1. The last is 0 if it could not be published; `unpublished` then
    says why, by its input. Of a group with a bundle, the set left as the `bundle`-th of these; 0 if that could not be
    published, of which `unpublished` says why behind all inputs where these have outputs of their own.
    """

    number: int
    latency: int
    common: int | None
    values: Sequence[int]
    missing: tuple[int, ...]
    unpublished: Mapping[int, str]
    bundle: int = 0


def header_stamp(content: Content) -> int:
    """Return the stamp of a header that begins a message; 0, as is never set, of one that is cut short."""
    return read_stamp(content) or 0


class ManifestWriter:
    """Serializes the manifests of a group.

    What sets have in common, down to the lengths of their numbers, is a template: code that runs once in some
    milliseconds costs by its length, as nothing of it is in the processor's caches.
    """

    def __init__(
        self, config: GroupConfig, *, node: str, topics: Sequence[tuple[str, str]], bundle: str | None
    ) -> None:
        """Take the node's full name, each input with its output, and the group's bundle, as the graph names them."""
        self._name, self._node = _text(config.name), _text(node)
        self._policy = _last_text(config.options.policy)
        self.is_by_header = tuple(topic.is_by_header for topic in config.topics)
        """Of which inputs a message's stamp is the one in its header."""
        self.has_bundles_alone = not config.options.outputs
        """Whether the messages of a set leave in bundles only."""
        self._offsets = tuple(topic.offset_ns for topic in config.topics)
        self._names = [(_text(output), _text(source)) for source, output in topics]
        self._bundle = None if bundle is None else _text(bundle)
        self._templates: dict[tuple[object, ...], tuple[bytes, int]] = {}

    def write(self, notes: Sequence[Note]) -> Sequence[bytes]:
        """Return the manifests of sets."""
        begins: list[bytes] = []
        rows: list[list[int]] = []
        for note in notes:
            stamps, common, missing = note.values[1::4], note.common, note.missing
            matched = stamps
            if any(self._offsets):
                # The span of `/status` and of `analyze` counts them, too.
                offsets = [each for index, each in enumerate(self._offsets) if index not in missing]
                matched = list(map(add, stamps, offsets))
            header = max(stamps) if common is None else common
            begins.append(_BEGIN(0, 1, 0, 0, *divmod(header, _NS_PER_SECOND)))
            row = [note.number, max(matched) - min(matched), note.latency]
            if common is not None:
                row.append(common)
            if self._bundle is not None:
                row.append(note.bundle)
            row += note.values
            rows.append(row)
        # All numbers at once, here and below: one by one takes twice as long.
        numbers = tuple(chain.from_iterable(rows))
        written = b"".join([b"%d " * len(row) + b"\n" for row in rows]) % numbers
        templates = [
            self._templates.get((note.missing, *note.unpublished.items(), shape)) or self._template(note, shape)
            for note, shape in zip(notes, written.translate(_ANY_DIGITS).splitlines(), strict=True)
        ]
        whole = b"".join([template for template, _ in templates]) % numbers
        ends = accumulate([size for _, size in templates])
        return [begin + whole[end - size : end] for begin, end, (_, size) in zip(begins, ends, templates, strict=True)]

    def _template(self, note: Note, shape: bytes) -> tuple[bytes, int]:
        """Return what numbers of so many digits are filled into, without the stamp, and its size then; keep it."""
        digits = shape.split()
        sizes = iter([len(each) for each in digits])
        inputs, unpublished = range(len(self._names)), note.unpublished
        kinds = [None if index in note.missing else unpublished.get(index, "") for index in inputs]
        # None is the place of digits.
        parts: list[bytes | None] = [self._head(len(note.missing), sum(map(bool, kinds)), unpublished.get(len(inputs)))]
        parts += (_key("set"), *_number(next(sizes)), _key("missing"), _text(str(len(note.missing))))
        parts += (_key("span_ns"), *_number(next(sizes)), _key("latency_ns"), *_number(next(sizes)))
        parts += (_key("common_stamp_ns"), *((_text(""),) if note.common is None else _number(next(sizes))))
        if self._bundle is not None:
            parts += (_key("bundle"), self._bundle, _key("bundle_sequence"), *_number(next(sizes)))
        parts += (_key("policy"), self._policy)
        at = len(self._policy) % 4
        for index, why_not in enumerate(kinds):
            parts.append(self._input(index, at, why_not))
            at = 0
            if why_not is not None:
                for name in ("stamp_ns", "original_stamp_ns", "received_ns"):
                    parts += (_key(name), *_number(next(sizes)))
                last = next(sizes) + 1
                parts += (_key("sequence"), _COUNT(last), None, b"\0")
                at = last % 4
        # A size may be that of a percent sign.
        content = b"".join([b"%d" if part is None else part.replace(b"%", b"%%") for part in parts])
        template = content, sum([len(part) for part in parts if part is not None]) + sum(map(len, digits))
        if len(self._templates) >= _MOST_TEMPLATES:
            self._templates.clear()
        self._templates[note.missing, *unpublished.items(), shape] = template
        return template

    def _head(self, missing: int, unpublished: int, unbundled: str | None) -> bytes:
        """Return what comes before the set's number: an empty frame_id, how many statuses, the first one's begin."""
        of = len(self._names)
        faults = [f"{missing} of {of} missing"] if missing else []
        faults += [f"{unpublished} of {of} not published"] if unpublished else []
        faults += [f"bundle not published: {unbundled[:_LONGEST]}"] if unbundled is not None else []
        level = _ERROR if unpublished or unbundled is not None else _WARN if missing else _OK
        message = _text(", ".join(faults) or "complete")
        version = _COUNT(7 if self._bundle is None else 9) + _key("version") + _text(str(_VERSION))
        return _text("") + _COUNT(1 + of) + _level(level, 0) + self._name + message + self._node + version

    def _input(self, index: int, at: int, why_not: str | None) -> bytes:
        """Return an input's status before its values, to stand `at` bytes behind a multiple of four.

        `why_not` is None of one that is missing, empty of one that was published.
        """
        output, source = self._names[index]
        if why_not is None:
            return _level(_STALE, at) + output + _text("missing") + source + _COUNT(0)
        level = _ERROR if why_not else _OK
        return _level(level, at) + output + _text(why_not[:_LONGEST]) + source + _COUNT(4)


def _level(level: int, at: int) -> bytes:
    """Return a level and what aligns the string behind it."""
    return bytes([level]) + bytes(3 - at)


def _last_text(text: str) -> bytes:
    """Return a string with nothing behind it, as a level needs no alignment."""
    content = text.replace("\0", "").encode(errors="replace") + b"\0"
    return _COUNT(len(content)) + content


def _text(text: str) -> bytes:
    """Return a string, and what aligns the next."""
    string = _last_text(text)
    return string + bytes(-len(string) % 4)


_key = _text


def _number(size: int) -> tuple[bytes, None, bytes]:
    """Return the place of a number of so many digits, and what aligns the next string."""
    return _COUNT(size + 1), None, bytes(1 + -(size + 1) % 4)
