"""The manifest of each set: a diagnostic_msgs/msg/DiagnosticArray, written as CDR by hand.

docs/reference/manifest.md is its contract. Whatever is the same in every set of a group is serialized once.
"""

from collections.abc import Mapping, Sequence
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
    """What the manifest of a set tells; of `stamps` and what follows, one for each input. Times in nanoseconds.

    `common` is the stamp that the set was given, if any. The stamp of a missing input is None. A message is the
    `sent`-th of its output, from 1; that of one that could not be published is 0, and `unpublished` says why, by its
    input. Of a group with a bundle, the set left as the `bundle`-th of these; 0 if that could not be published, of
    which `unpublished` says why behind all inputs where these have outputs of their own.
    """

    number: int
    latency: int
    common: int | None
    stamps: Sequence[int | None]
    left_as: Sequence[int | None]
    received: Sequence[int | None]
    sent: Sequence[int]
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
        self._templates: dict[tuple[object, ...], bytes] = {}

    def write(self, note: Note) -> bytes:
        """Return the manifest of a set."""
        stamps, common, unpublished = note.stamps, note.common, note.unpublished
        # With the offsets, as the span of `/status` and of `analyze`.
        matched = [stamp + offset for stamp, offset in zip(stamps, self._offsets, strict=True) if stamp is not None]
        header = max([stamp for stamp in stamps if stamp is not None]) if common is None else common
        numbers = [note.number, len(stamps) - len(matched), max(matched) - min(matched), note.latency]
        if common is not None:
            numbers.append(common)
        if self._bundle is not None:
            numbers.append(note.bundle)
        rows = zip(note.left_as, stamps, note.received, note.sent, strict=True)
        values = [value for row in rows if row[1] is not None for value in row]
        kinds = tuple([None if stamp is None else unpublished.get(index, "") for index, stamp in enumerate(stamps)])
        # At once: one by one takes half as long again.
        written = b"%d " * (len(numbers) + len(values)) % (*numbers, *values)
        digits, unbundled = written.split(), unpublished.get(len(stamps))
        key = (common is None, kinds, unbundled, written.translate(_ANY_DIGITS))
        template = self._templates.get(key) or self._template(key, digits, kinds, unbundled)
        return template % (_BEGIN(0, 1, 0, 0, *divmod(header, _NS_PER_SECOND)), *digits)

    def _template(
        self, key: tuple[object, ...], digits: Sequence[bytes], kinds: Sequence[str | None], unbundled: str | None
    ) -> bytes:
        """Return what the stamp and these digits, or others of their lengths, are filled into, and keep it."""
        sizes = iter([len(each) for each in digits])
        has_no_common = key[0]
        # None is the place of digits.
        parts: list[bytes | None] = [None, self._head(kinds.count(None), sum(map(bool, kinds)), unbundled)]
        for name in ("set", "missing", "span_ns", "latency_ns"):
            parts += (_key(name), *_number(next(sizes)))
        parts += (_key("common_stamp_ns"), *((_text(""),) if has_no_common else _number(next(sizes))))
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
        template = b"".join([b"%b" if part is None else part.replace(b"%", b"%%") for part in parts])
        if len(self._templates) >= _MOST_TEMPLATES:
            self._templates.clear()
        self._templates[key] = template
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
