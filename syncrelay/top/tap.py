"""Follows what leaves a relay, over HTTP: asks again and again for what has left since."""

import json
import secrets
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Final
from urllib.parse import urlencode, urlsplit

from pydantic import Field, TypeAdapter, ValidationError

from syncrelay.status.document import Text
from syncrelay.top.client import NoAnswerError, OtherServerError, connection_to, get

_NAME_BYTES: Final = 8


@dataclass(frozen=True, slots=True)
class SetLine:
    """A set; times and durations in nanoseconds. Stamps are as they came, without the `offsets` of their inputs."""

    group: Text
    time: int
    stamps: Mapping[Text, int | None]
    offsets: Mapping[Text, int]
    span: int
    latency: int


@dataclass(frozen=True, slots=True)
class DropLine:
    """A message that left unmatched; times in nanoseconds. `unneeded`: it cost no set, as far as the relay tells."""

    group: Text
    time: int
    topic: Text
    stamp: int
    received: int
    reason: Text
    unneeded: bool = False


@dataclass(frozen=True, slots=True)
class Told:
    """What has left: lines as they came; `lost` counts what was too old to be told, None where nobody counted."""

    after: Annotated[int, Field(ge=0)]
    more: bool
    lost: int | None
    lines: tuple[dict[str, Any], ...]


_TOLD: Final = TypeAdapter(Told)
_LINE: Final = TypeAdapter[SetLine | DropLine](SetLine | DropLine)


def read_line(line: Mapping[str, Any]) -> SetLine | DropLine:
    """Return a line as a value. Raises OtherServerError where it is none."""
    try:
        return _LINE.validate_python(line)
    except ValidationError as error:
        raise OtherServerError("what listens there is not a relay, or runs another version") from error


class Tap:
    """A tap on the relay at a base URL. Of what leaves it wants the named groups, inputs and reasons; empty is all."""

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

    def read(self) -> Told:
        """Return what has left since this was last called; at first, nothing. Raises as top.client.ask does."""
        target = f"{self._path}?{urlencode(self._fields, doseq=True)}"
        try:
            body = get(self._connection, target)
        except NoAnswerError:
            # The relay ends what is idle for some seconds, as when we had to wait for who reads our lines.
            self._connection.close()
            body = get(self._connection, target)
        try:
            told = _TOLD.validate_python(json.loads(body))
        except (ValueError, RecursionError) as error:
            raise OtherServerError("what listens there is not a relay, or runs another version") from error
        self._fields["after"] = told.after
        return told
