"""Follows the sets and drops of a relay over HTTP: asks again and again for those since the last answer."""

import json
import secrets
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Final, TypeAlias
from urllib.parse import urlencode, urlsplit

from pydantic import Field, TypeAdapter, ValidationError

from syncrelay.status.document import Text
from syncrelay.top.client import NoAnswerError, OtherServerError, connection_to, get

_NAME_BYTES: Final = 8

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


def read_line(line: Mapping[str, Any]) -> SetLine | DropLine:
    """Return a line as a value. Raises OtherServerError if it is malformed."""
    try:
        return _LINE.validate_python(line)
    except ValidationError as error:
        raise OtherServerError("what listens there is not a relay, or runs another version") from error


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
