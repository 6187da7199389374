"""What a user can see of a script, in words that are the same in every ROS."""

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

from syncrelay.config.profile import Profile
from syncrelay.explain import Code
from syncrelay.relay.ports import EndpointInfo

MS: Final = 1_000_000
KNOWN: Final = Path(__file__).with_name("seen.txt")
"""What each script shows; `python -m tests.conformance` prints it."""
# How findings are worded is held by tests/explain/findings.txt; whom they name is held here.
_CODES: Final = frozenset(code.value for code in Code)
# Of a status; the rest is held by other tests, or noted with "at the end".
_SHOWN: Final = (
    *("relay", "node", "phase", "ready", "uptime_s", "reloads", "refused_reloads", "reload_error"),
    *("groups", "level", "sets", "since_last_set_ms", "findings", "code", "text", "suggestion"),
    *("inputs", "output", "lost", "publishers", "senders", "sent", "delivered", "subscribers"),
    *("mismatch", "offered", "requested"),
)
_NAME: Final = re.compile(r"(?<!\w)/\w[\w/]*")
# In the sources of ROS.
_PLACE: Final = re.compile(r", at [^ ,]+:\d+")
# With its unit, which goes by the size of a duration.
_NUMBER: Final = re.compile(r"\d+(\.\d+)?( (ns|us|ms|s)\b)?")


@dataclass
class Seen:
    """What a user could see."""

    outputs: dict[str, list[str]] = field(default_factory=dict)
    """Of each subscriber: its messages, by time and frame."""
    notes: list[Any] = field(default_factory=list)
    """What was asked for, in the order of the script."""
    log: list[str] = field(default_factory=list)
    """The warnings and errors of the relay."""
    inside: list[str] = field(default_factory=list, compare=False)
    """What depends on the moment, and is the same again only in the simulated ROS: its log and its last status."""


def told(title: str, seen: Seen, blind: Sequence[str]) -> str:
    """Write down what was seen but for what depends on chance: a line for each output, note and line of the log."""
    outputs = [f"{name}: {_messages(texts)}" for name, texts in seen.outputs.items()]
    notes = [_note(note) for note in seen.notes]
    if "outputs" in blind:
        seen.inside.append(", ".join(f"{name}: {len(texts)}" for name, texts in seen.outputs.items()))
    fields = {"outputs": outputs, "notes": notes}
    shown = [line for field, lines in fields.items() if field not in blind for line in lines]
    return "\n".join([title, *shown, *filter(None, seen.inside)])


def short_of(document: Any) -> str:
    """Write down what a status says of the graph and of the relay: nothing that is empty or 0."""
    match document:
        case dict():
            rows = [(key, short_of(value)) for key, value in document.items() if key in _SHOWN]
            return " ".join(f"{key}={value}" for key, value in rows if value)
        case list():
            return "".join(f"({short_of(each)})" for each in document)
        case float():
            return f"{document:.1f}" if document else ""
        case _:
            return str(document or "")


def _messages(texts: Sequence[str]) -> str:
    """Write the time of each message, and whose they are where that changes."""
    words, before = list[str](), ""
    for text in texts:
        when, _, frame = text.partition(" ")
        words += [when.removesuffix(".000")] if frame == before else [frame, when.removesuffix(".000")]
        before = frame
    return " ".join(words)


def _note(note: Sequence[Any]) -> str:
    first, *rest = note
    if first in _CODES:
        return " ".join([first, *sorted({name for words in rest for name in _NAME.findall(words)})])
    return " ".join([str(first), *(_short(each) for each in rest)])


def _short(said: Any) -> str:
    return " / ".join(map(str.strip, str(said).split("\n")[:2])).replace("geometry_msgs/msg/", "").replace("'", "")


def message(content: bytes, begin: int) -> str:
    """Say which message this is, of a script that began then."""
    if len(content) < 20:
        return content.hex()
    stamp = int.from_bytes(content[4:8], "little", signed=True) * 10**9 + int.from_bytes(content[8:12], "little")
    size = int.from_bytes(content[12:16], "little")
    with suppress(UnicodeDecodeError):
        offset = (stamp - begin) / MS
        when = f"{offset:.3f}" if abs(offset) < 86_400_000 else "other"
        return f"{when} {content[16 : 16 + size - 1].decode()}"
    return content[4:].hex()


def without_figures(text: str) -> str:
    """Leave numbers out, and places in the sources of ROS."""
    return _NUMBER.sub("#", _PLACE.sub("", text))


def endpoint(each: EndpointInfo, *, named: bool) -> tuple[str, ...]:
    """Say of which node an endpoint is, of what type, and in what its profile is unlike a usual one of the graph."""
    usual = Profile(history="unknown", depth=0, liveliness="automatic")
    unlike = [f"{key}={value}" for key, value in asdict(each.profile).items() if value != getattr(usual, key)]
    return (f"{each.node_namespace} {each.node_name}" if named else "", each.type, *unlike)


def by_reason(dropped: Mapping[Any, int]) -> dict[str, int]:
    """Leave out the reasons for which nothing was dropped."""
    return {reason.value: count for reason, count in dropped.items() if count}
