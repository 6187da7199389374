"""The state of a relay as /status gives it, read back as values. Durations in milliseconds, as in the document."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, TypeAlias

from pydantic import AfterValidator, BeforeValidator, TypeAdapter, ValidationError

from syncrelay.errors import SyncRelayError
from syncrelay.explain import RecentDrop, RecentSet
from syncrelay.printable import printable
from syncrelay.status import Level, Phase

Text: TypeAlias = Annotated[str, AfterValidator(printable)]
"""A text as it may be shown: who answers at a port may be anyone."""


class NotAStateError(SyncRelayError):
    """What was read is not the state of a relay, or that of another version."""


@dataclass(frozen=True, slots=True)
class Relay:
    """The relay as a whole, its reloads as RelayState has them. `pid` is its number where it runs, 0 if not told."""

    node: Text
    version: Text
    config: Text
    phase: Phase
    ready: bool
    uptime_s: float
    pid: int = 0
    reloads: int = 0
    refused_reloads: int = 0
    reload_error: str | None = None


@dataclass(frozen=True, slots=True)
class Percentiles:
    """Of the last sets."""

    p50: float
    p95: float
    max: float


@dataclass(frozen=True, slots=True)
class SetFigures:
    """One set that left."""

    span_ms: float
    latency_ms: float


@dataclass(frozen=True, slots=True)
class Tolerance:
    """The key of the file that says how far apart the stamps of a set may be."""

    key: Text
    ms: float


@dataclass(frozen=True, slots=True)
class Mismatch:
    """A QoS policy by which two do not connect."""

    policy: Text
    offered: Text
    requested: Text


@dataclass(frozen=True, slots=True)
class Endpoint:
    """A publisher of an input or a subscriber of an output."""

    node: Text
    type: Text
    mismatch: Mismatch | None


@dataclass(frozen=True, slots=True)
class Input:
    """An input and its output. What is `lately` is of the last ten seconds, `missing` a share of the sets.

    `other_drops` are the dropped messages but for those that were not needed, None where that is not told.
    """

    topic: Text
    type: Text | None
    output: Text
    required: bool
    rate_hz: float
    age_ms: float | None
    lag_ms: float | None
    jitter_ms: float | None
    received: int
    matched: int
    buffered: int
    dropped: Mapping[Text, int]
    dropped_lately: Mapping[Text, int]
    lost: int
    missing: float
    publishers: tuple[Endpoint, ...]
    subscribers: tuple[Endpoint, ...]
    offset_ms: float = 0.0
    unneeded: int = 0
    unneeded_lately: int = 0
    other_drops: Mapping[Text, int] | None = None
    other_drops_lately: Mapping[Text, int] | None = None


@dataclass(frozen=True, slots=True)
class Finding:
    """What the relay found; `topics` are the inputs that it is about, `topic` the one if it is one.

    `severity` is never STALE.
    """

    code: Text
    severity: Level
    text: Text
    suggestion: Text | None
    topic: Text | None = None
    topics: tuple[Text, ...] = ()

    @property
    def label(self) -> str:
        """Its code in words."""
        return self.code.replace("_", " ")


def _outcome(told: Any) -> Any:
    match told:
        case {"set": stamps}:
            return {"stamps": stamps}
        case {"drop": drop}:
            return drop
        case _:
            return told


@dataclass(frozen=True, slots=True)
class Group:
    """A group; `last_sets` and `recent` oldest first, `findings` with the one that explains most first."""

    name: Text
    policy: Text
    level: Level
    queue_size: int
    tolerance: Tolerance | None
    max_wait_ms: float | None
    sets: int
    rate_hz: float
    possible_hz: float
    since_last_set_ms: float | None
    span_ms: Percentiles | None
    latency_ms: Percentiles | None
    last_sets: tuple[SetFigures, ...]
    inputs: tuple[Input, ...]
    findings: tuple[Finding, ...]
    recent: tuple[Annotated[RecentSet | RecentDrop, BeforeValidator(_outcome)], ...]
    span_without_offsets_ms: float | None = None

    @property
    def explanation(self) -> Finding | None:
        """The finding that explains most, None where there is none."""
        return self.findings[0] if self.findings else None

    @property
    def problems(self) -> list[Finding]:
        """What is wrong."""
        return [finding for finding in self.findings if finding.severity is not Level.OK]

    def problem_of(self, an_input: Input) -> Finding | None:
        """What is wrong with one of its inputs, before all else; None if nothing is."""
        return next((finding for finding in self.problems if an_input.topic in (finding.topic, *finding.topics)), None)


@dataclass(frozen=True, slots=True)
class State:
    """A relay at one moment."""

    relay: Relay
    groups: tuple[Group, ...]


@cache
def _reader() -> TypeAdapter[State]:
    """Return what reads a state, made when one is first asked for: a relay may never be."""
    return TypeAdapter(State)


def state_of(document: Mapping[str, Any]) -> State:
    """Return the state that a document of this process holds."""
    return _reader().validate_python(document)


def read_state(document: bytes) -> State:
    """Return the state that a JSON document holds; ignores keys that it does not know. Raises NotAStateError."""
    try:
        return _reader().validate_json(document)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"])) or "the document"
        raise NotAStateError(printable(f"{where}: {first['msg']}")) from error
