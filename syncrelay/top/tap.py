"""Follows the sets and drops of a relay over HTTP, by asking for those since the last answer; says them in words."""

import json
import secrets
import time
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Final, TypeAlias
from urllib.parse import urlencode, urlsplit

from pydantic import Field, TypeAdapter, ValidationError

from syncrelay.explain import words
from syncrelay.status.document import Text
from syncrelay.sync import DropReason
from syncrelay.top.client import NoAnswerError, OtherServerError, connection_to, get

_NAME_BYTES: Final = 8
_NS_PER_S: Final = 1_000_000_000
# Columns of a line that says what a reason means.
_WIDTH: Final = 120

Time: TypeAlias = Annotated[int, Field(ge=-(1 << 63), lt=1 << 63)]
"""A time that has a date."""

Nanoseconds: TypeAlias = Annotated[int, Field(ge=-(1 << 80), lt=1 << 80)]
"""A stamp, which may come from a field of 64 bits, or a duration."""


@dataclass(frozen=True, slots=True)
class SetLine:
    """A set; times and durations in nanoseconds. Its stamps do not include the `offsets` of the inputs."""

    group: Text
    time: Time
    stamps: Mapping[Text, Nanoseconds | None]
    offsets: Mapping[Text, Nanoseconds]
    span: Nanoseconds
    latency: Nanoseconds


@dataclass(frozen=True, slots=True)
class DropLine:
    """A dropped message; times in nanoseconds. `unneeded` says that it cost no set, as far as the relay knows."""

    group: Text
    time: Time
    topic: Text
    stamp: Nanoseconds
    received: Time
    reason: Text
    unneeded: bool = False


@dataclass(frozen=True, slots=True)
class TapAnswer:
    """Sets and drops as lines; `lost` counts those that were discarded before, None if nobody counted."""

    after: Annotated[int, Field(ge=0)]
    more: bool
    lost: int | None
    lines: tuple[dict[str, Any], ...]


_ANSWER: Final = TypeAdapter(TapAnswer)
_LINE: Final = TypeAdapter[SetLine | DropLine](SetLine | DropLine)


class Tap:
    """A tap on the relay at a base URL, for the named groups, inputs and reasons; an empty choice is all."""

    def __init__(
        self,
        url: str,
        *,
        groups: Collection[str] = (),
        inputs: Collection[str] = (),
        reasons: Collection[str] = (),
        drops: bool = False,
    ) -> None:
        self._connection = connection_to(url)
        self._path = f"{urlsplit(url).path}/tap"
        wanted = {"group": list(groups), "input": list(inputs), "reason": list(reasons), "drops": int(drops)}
        self._fields: dict[str, object] = {"tap": secrets.token_hex(_NAME_BYTES), **wanted}

    def close(self) -> None:
        """End the connection."""
        self._connection.close()

    def read(self) -> TapAnswer:
        """Return the sets and drops since the last call, at first none. Raises as top.client.ask does."""
        target = f"{self._path}?{urlencode(self._fields, doseq=True)}"
        try:
            body = get(self._connection, target)
        except NoAnswerError:
            # The relay closes idle connections, such as ours while we wait for the reader of our lines.
            self._connection.close()
            body = get(self._connection, target)
        try:
            answer = _ANSWER.validate_python(json.loads(body))
        except (ValueError, RecursionError) as error:
            raise OtherServerError("what listens there is not a relay, or runs another version") from error
        self._fields["after"] = answer.after
        return answer


def plain_line(line: dict[str, Any]) -> str:
    """Say a line in words: of a set, how much later than the earliest each stamp is, with the inputs' offsets.

    Raises OtherServerError if it is malformed.
    """
    read = _read(line)
    seconds, rest = divmod(read.time, _NS_PER_S)
    when = f"{time.strftime('%H:%M:%S', time.localtime(seconds))}.{rest // 1_000_000:03}"
    begin = f"{when} {read.group}:"
    return f"{begin} {_of_set(read)}" if isinstance(read, SetLine) else _of_drop(begin, read)


def _of_set(line: SetLine) -> str:
    matched = {
        topic: None if stamp is None else stamp + line.offsets.get(topic, 0) for topic, stamp in line.stamps.items()
    }
    first = min((stamp for stamp in matched.values() if stamp is not None), default=0)
    inputs = ", ".join(f"{topic} {_after(stamp, first)}" for topic, stamp in matched.items())
    return f"set, span {words.duration(line.span)}, latency {words.duration(line.latency)}: {inputs}"


def _after(stamp: int | None, first: int) -> str:
    return "missing" if stamp is None else f"+{words.duration(stamp - first)}"


def _of_drop(begin: str, line: DropLine) -> str:
    """Say what the reason means where that fits."""
    meaning = {each.value: f" ({each.meaning})" for each in DropReason}.get(line.reason, "")
    waited = f" after {words.duration(line.time - line.received)}"
    if line.unneeded:
        return f"{begin} drop, {line.topic} not needed ({line.reason}){waited}"
    what = f"{begin} drop, {line.topic} {line.reason}"
    return f"{what}{meaning if len(what + meaning + waited) <= _WIDTH else ''}{waited}"


def _read(line: Mapping[str, Any]) -> SetLine | DropLine:
    try:
        return _LINE.validate_python(line)
    except ValidationError as error:
        raise OtherServerError("what listens there is not a relay, or runs another version") from error
