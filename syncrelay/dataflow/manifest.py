"""What is told of each set on a topic of its own: a diagnostic_msgs/msg/DiagnosticArray, written as CDR by hand.

docs/manifest.md is its contract. Whatever is the same in every set of a group is serialized once.
"""

from collections.abc import Sequence
from struct import Struct
from typing import Final, NamedTuple

from syncrelay.config import GroupConfig
from syncrelay.sync import Match

MANIFEST_DEPTH: Final = 500
"""How many DDS keeps of a group: who joins sets needs each one, and a hiccup of some seconds must cost none."""

_VERSION: Final = 1

_NS_PER_SECOND: Final = 1_000_000_000
# As DiagnosticStatus has them.
_OK, _WARN, _ERROR, _STALE = range(4)
_COUNT: Final = Struct("<I").pack
# The encapsulation header of little-endian CDR, then the stamp.
_BEGIN: Final = Struct("<4BiI").pack
# Whatever is a number here has no more digits, be it negative.
_DIGITS: Final = 32
# Why a message could not be published is told in DDS's words, this far.
_LONGEST: Final = 200


class Member(NamedTuple):
    """A message of a set: its stamp as it leaves and as it came, and when it was received, in nanoseconds.

    It is the `sequence`-th message of its output, from 1. One that could not be published has 0, and a reason.
    """

    stamp: int
    original_stamp: int
    received: int
    sequence: int
    why_not: str = ""


class ManifestWriter:
    """Serializes the manifests of a group."""

    def __init__(self, config: GroupConfig, *, node: str, topics: Sequence[tuple[str, str]]) -> None:
        """Take the node's full name, and each input with its output, as the graph names them."""
        self._name, self._node = _text(config.name), _text(node)
        self._policy = _key("policy") + _last_text(config.options.policy)
        self._behind_policy = len(self._policy) % 4
        self._offsets = tuple(topic.offset_ns for topic in config.topics)
        self._names = [(_text(output), _text(source)) for source, output in topics]
        self._present = [[self._input(each, at, _OK, "") for at in range(4)] for each in range(len(topics))]
        self._missing = [[self._input(each, at, _STALE, "missing") for at in range(4)] for each in range(len(topics))]
        self._heads: dict[tuple[int, int], bytes] = {}

    def write(self, number: int, match: Match, members: Sequence[Member | None], latency: int) -> bytes:
        """Return the manifest of a set, which is the `number`-th of its group; `latency` in ns."""
        there = [message for message in match.messages if message is not None]
        missing = len(members) - len(there)
        unpublished = sum([1 for member in members if member is not None and member.why_not])
        offsets, common = self._offsets, match.stamp
        # With the offsets, as the span of `/status` and of `analyze`.
        matched = [message.stamp + offsets[message.input] for message in there]
        stamp = max([message.stamp for message in there]) if common is None else common
        parts = [
            _BEGIN(0, 1, 0, 0, *divmod(stamp, _NS_PER_SECOND)),
            self._heads.get((missing, unpublished)) or self._head(missing, unpublished),
            _number(number),
            _MISSING,
            _number(missing),
            _SPAN,
            _number(max(matched) - min(matched)),
            _LATENCY,
            _number(latency),
            _COMMON_STAMP,
            _NO_STAMP if common is None else _number(common),
            self._policy,
        ]
        at = self._behind_policy
        for index, member in enumerate(members):
            if member is None:
                parts.append(self._missing[index][at])
                at = 0
                continue
            why_not = member.why_not
            digits = b"%d" % member.received
            parts += (
                self._input(index, at, _ERROR, why_not) if why_not else self._present[index][at],
                _number(member.sequence),
                _STAMP,
                _number(member.stamp),
                _ORIGINAL_STAMP,
                _number(member.original_stamp),
                _RECEIVED,
                _COUNT(len(digits) + 1),
                digits,
                b"\0",
            )
            at = (len(digits) + 1) % 4
        return b"".join(parts)

    def _head(self, missing: int, unpublished: int) -> bytes:
        """Return what comes before the set's number: an empty frame_id, how many statuses, the first one's begin."""
        of = len(self._names)
        faults = [f"{missing} of {of} missing"] if missing else []
        faults += [f"{unpublished} of {of} not published"] if unpublished else []
        level = _ERROR if unpublished else _WARN if missing else _OK
        message = _text(", ".join(faults) or "complete")
        version = _COUNT(7) + _key("version") + _text(str(_VERSION)) + _key("set")
        head = _text("") + _COUNT(1 + of) + _level(level, 0) + self._name + message + self._node + version
        self._heads[missing, unpublished] = head
        return head

    def _input(self, index: int, at: int, level: int, message: str) -> bytes:
        """Return an input's status before the first of its values, to stand `at` bytes behind a multiple of four."""
        output, source = self._names[index]
        values = _COUNT(0) if level == _STALE else _COUNT(4) + _key("sequence")
        return _level(level, at) + output + _text(message[:_LONGEST]) + source + values


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


def _number(value: int) -> bytes:
    """Return a number as a string, and what aligns the next."""
    digits = b"%d" % value
    return _BEFORE[len(digits)] + digits + _AFTER[len(digits)]


_BEFORE: Final = tuple(_COUNT(length + 1) for length in range(_DIGITS))
_AFTER: Final = tuple(bytes(1 + -(length + 1) % 4) for length in range(_DIGITS))
_NO_STAMP: Final = _text("")
_MISSING, _SPAN, _LATENCY, _COMMON_STAMP = map(_key, ("missing", "span_ns", "latency_ns", "common_stamp_ns"))
_STAMP, _ORIGINAL_STAMP, _RECEIVED = map(_key, ("stamp_ns", "original_stamp_ns", "received_ns"))
