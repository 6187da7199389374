"""Analyses of single recordings, as `analyze --json` prints them: what a fleet's report reads of one."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Final, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from syncrelay.errors import BagError, SyncRelayError

ANALYSIS: Final = "analysis.json"
"""The file of a recording's analysis in the folder of its result."""

# A document that lies must not fill the memory: so many buckets have all numbers of 64 bits.
_MOST_BUCKETS: Final = 1100
_MOST_BYTES: Final = 100_000_000

Count = Annotated[int, Field(ge=0, le=2**63)]
Nanoseconds = Annotated[int, Field(ge=-(2**63), le=2**63)]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore", allow_inf_nan=False)


class Spread(_Part):
    """A quantity in nanoseconds, some of the percentiles that a document has."""

    least: Nanoseconds
    median: Nanoseconds
    greatest: Nanoseconds


class Quantity(_Part):
    """A quantity of sets in nanoseconds: how often it was in which bucket, by the floors of these."""

    least: Nanoseconds
    greatest: Nanoseconds
    counts: dict[Nanoseconds, Count] = Field(max_length=_MOST_BUCKETS)


class Topic(_Part):
    """The figures of a topic."""

    topic: str
    messages: Count
    gaps: Count
    longest_gap: Count | None
    duplicates: Count
    out_of_order: Count
    unstamped: Count
    unreadable: Count
    delay: Spread | None
    drift_ppm: float | None


class Input(_Part):
    """Where the messages of an input went; those that are not needed are among the dropped."""

    topic: str
    received: Count
    matched: Count
    dropped: dict[str, Count]
    unneeded: Count


class Pair(_Part):
    """How far the messages of two topics lie apart."""

    first: str
    second: str
    distance: Spread


class Finding(_Part):
    """What the running relay would have found; `input` is the index of an input."""

    code: str
    severity: Literal["ok", "warn", "error"]
    text: str
    suggestion: str | None
    input: Annotated[int, Field(ge=0)] | None
    seconds: Count


class Change(_Part):
    """A better value of a group's key, or of one of its inputs by index."""

    topic: Annotated[int, Field(ge=0)] | None
    key: str
    value: str | int


class Suggestion(_Part):
    """Better values, and how many sets they give of the possible ones."""

    possible: Count
    now: Count
    then: Count
    changes: tuple[Change, ...]


class Group(_Part):
    """What a group made of a recording. Without spans where syncrelay did not count them yet."""

    name: str
    sets: Count
    span: Quantity | None = None
    latency: Quantity | None = None
    inputs: tuple[Input, ...]
    pairs: tuple[Pair, ...]
    findings: tuple[Finding, ...]
    suggestion: Suggestion

    @model_validator(mode="after")
    def _indices(self) -> Self:
        named = [*(each.input for each in self.findings), *(each.topic for each in self.suggestion.changes)]
        if any(index is not None and index >= len(self.inputs) for index in named):
            raise ValueError("names an input that the group does not have")
        return self

    def topic_of(self, index: int | None) -> str | None:
        """Return the topic of an input by its index."""
        return None if index is None else self.inputs[index].topic


class Document(_Part):
    """An analysis of a recording, which `begin` and `end` are the times of, in nanoseconds of UTC."""

    begin: Nanoseconds
    end: Nanoseconds
    topics: tuple[Topic, ...]
    groups: tuple[Group, ...]


def read_document(name: str, found: object) -> Document:
    """Return what json.loads made of an analysis. Raises BagError where it is none, or one without groups."""
    try:
        document = Document.model_validate(found)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False, include_input=False)[0]
        where = ".".join(map(str, first["loc"])) or "the document"
        raise BagError(
            f"{name}: is not what `syncrelay analyze --config FILE --json` prints: {where}: {first['msg']}"
        ) from error
    if not document.groups:
        raise BagError(f"{name}: no group was analyzed: name the file with --config FILE")
    return document


def documents_in(folder: Path) -> Iterator[tuple[str, object]]:
    """Yield the recordings and the documents that `analyze --into` left in a folder, by the names of their results.

    What cannot be read as JSON is yielded as None, under the name of its file.
    """
    try:
        results = sorted(path for path in folder.iterdir() if not path.name.startswith("."))
    except OSError as error:
        raise SyncRelayError(f"{folder}: cannot be read: {error.strerror}") from error
    for result in results:
        path = result / ANALYSIS
        if path.is_file():
            yield _document(path)


def _document(path: Path) -> tuple[str, object]:
    try:
        found = json.loads(path.read_bytes()) if path.stat().st_size <= _MOST_BYTES else None
    except (OSError, ValueError, RecursionError):
        found = None
    recording = found.get("recording") if isinstance(found, dict) else None
    return (recording if isinstance(recording, str) else str(path), found)
