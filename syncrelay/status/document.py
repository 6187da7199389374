"""The document that /status gives: what the relay writes, and what everything that watches a relay reads.

Durations are in milliseconds, stamps in nanoseconds. What is not known yet is None, null in JSON. A newer relay may
send more than is here, which readers ignore; a field with a default may be missing from an older one.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Final, TypeAlias

from pydantic import AfterValidator, BeforeValidator, Field, PlainSerializer, TypeAdapter, ValidationError

from syncrelay.errors import SyncRelayError
from syncrelay.explain import RecentDrop, RecentSet
from syncrelay.printable import printable
from syncrelay.status.state import Level, Phase

Text: TypeAlias = Annotated[str, AfterValidator(printable)]
"""A text that is safe to show: what answers at a port may be anything."""

Number: TypeAlias = Annotated[float, Field(ge=-1e18, le=1e18, allow_inf_nan=False)]
"""A number that can be rounded and drawn, whatever a relay may have made of stamps that make no sense."""

Rate: TypeAlias = Annotated[float, Field(ge=0, le=1e18, allow_inf_nan=False)]
"""A rate in Hz."""

# A field of 64 bits may hold a stamp, and offsets are added.
_STAMPS: Final = range(-(1 << 80), 1 << 80)


class NotAStatusError(SyncRelayError):
    """The bytes are not the status of a relay, or that of a version whose status has another shape."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Relay:
    """The relay as a whole."""

    node: Text
    """Its name on the ROS graph, with its namespace."""
    version: Text
    """The version of syncrelay that runs."""
    config: Text
    """The files that it runs."""
    phase: Phase
    """Where it is in its life."""
    ready: bool
    """The same as `/readyz`."""
    uptime_s: Number
    """Seconds since its start."""
    receives_by: Text = ""
    """How messages are taken and published."""
    reloads: int = 0
    """How often the file was read again and taken over."""
    refused_reloads: int = 0
    """How often a reload failed, so that the running configuration was kept."""
    reload_error: str | None = None
    """Why the last reload failed."""
    pid: int = 0
    """Its process id, in the container or on the machine where it runs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Percentiles:
    """Percentiles of durations, in milliseconds."""

    p50: Number
    """The median."""
    p95: Number
    """Larger than 95 % of them."""
    max: Number
    """The largest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SetFigures:
    """One set that left."""

    span_ms: Number
    """Its latest stamp minus its earliest, offsets added."""
    latency_ms: Number
    """From the receipt of its last message until it was published."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerance:
    """How far apart the stamps of a set may be."""

    key: Text
    """The key of the file that says so, such as `slop`."""
    ms: Number
    """Its value."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mismatch:
    """A QoS policy that keeps a publisher and a subscriber from connecting."""

    policy: Text
    """The policy."""
    offered: Text
    """What the publisher offers."""
    requested: Text
    """What the subscriber requests."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Endpoint:
    """A publisher of an input, or a subscriber of an output."""

    node: Text
    """The node that it belongs to."""
    type: Text
    """Its message type."""
    mismatch: Mismatch | None
    """Why it does not connect to the relay; null if it does."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sender:
    """A node that published an input in the last 10 s, and how many of its messages came, by the numbers they have."""

    node: Text
    """The node."""
    sent: int
    """Messages that it published, from the first that came on."""
    delivered: int
    """Those of them that came."""
    lost: int
    """Those that did not."""
    sent_hz: Rate | None
    """The rate at which it published the last ones, by its own clock."""
    way_ms: Number | None
    """The least time from publication to receipt: by two clocks if it runs on another machine."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Input:
    """An input of a group and its output. Counts are since the start; what ends in `_lately` is of the last 10 s."""

    topic: Text
    """The input topic."""
    type: Text | None
    """Its type; null until the graph shows it, where the file does not say it."""
    output: Text
    """The topic that its messages are republished on."""
    required: bool
    """Whether every set needs a message of it, or it is one of those of which a set needs as many as `quorum` says."""
    offset_ms: Number = 0.0
    """What the file adds to its stamps for matching."""
    rate_hz: Rate
    """Messages a second by receipt, 0 while it is silent."""
    age_ms: Number | None = None
    """How long ago its last message arrived."""
    lag_ms: Number | None
    """Time of receipt minus stamp, median."""
    jitter_ms: Number | None
    """How far the time between its stamps is from the median, 95th percentile."""
    drift_ppm: Number | None = None
    """How much its clock is slower than the clock of this machine, in parts per million."""
    received: int
    """Messages received: those in sets, those dropped and those still waiting."""
    matched: int
    """Messages that left in sets."""
    buffered: int
    """Messages that wait in the queue."""
    dropped: Mapping[Text, int]
    """Dropped messages by reason."""
    unneeded: int = 0
    """Dropped messages that cost no set."""
    other_drops: Mapping[Text, int] | None = None
    """The other dropped messages by reason."""
    dropped_lately: Mapping[Text, int]
    """As `dropped`."""
    unneeded_lately: int = 0
    """As `unneeded`."""
    other_drops_lately: Mapping[Text, int] | None = None
    """As `other_drops`."""
    lost: int
    """Messages that were published and did not come, lately: by their numbers, or else as DDS reports it."""
    missing: Number
    """The share of the last sets that left without it, 0 to 1."""
    publishers: tuple[Endpoint, ...]
    """Who publishes the topic."""
    senders: tuple[Sender, ...] = ()
    """What came of each node's messages, lately; empty where messages do not say whose they are."""
    subscribers: tuple[Endpoint, ...]
    """Who subscribes to the output."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """Something that was found out about a group."""

    code: Text
    """One of the findings, the same in every version."""
    severity: Level
    """How bad it is; never `stale`."""
    text: Text
    """A sentence for people; its words may change with a version."""
    suggestion: Text | None
    """What to do about it."""
    topic: Text | None = None
    """The input that it is about; null if it is about several or about the group."""
    topics: tuple[Text, ...] = ()
    """All inputs that it is about."""

    @property
    def label(self) -> str:
        """Its code in words."""
        return self.code.replace("_", " ")


def _read_recent(recent: Any) -> Any:
    match recent:
        case {"set": stamps}:
            return {"stamps": stamps}
        case {"drop": drop}:
            return drop
        case _:
            return recent


def _write_recent(recent: RecentSet | RecentDrop) -> dict[str, Any]:
    if isinstance(recent, RecentSet):
        return {"set": recent.stamps}
    drop = {"input": recent.input, "stamp": recent.stamp, "reason": recent.reason.value, "unneeded": recent.unneeded}
    return {"drop": drop}


Recent: TypeAlias = Annotated[
    RecentSet | RecentDrop, BeforeValidator(_read_recent), PlainSerializer(_write_recent, return_type=dict[str, Any])
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """A group."""

    name: Text
    """Its name in the file."""
    policy: Text
    """The policy that matches its messages."""
    level: Level
    """The severity of its worst finding, or `stale` where nothing comes in at all."""
    queue_size: int
    """Messages kept for each input."""
    tolerance: Tolerance | None
    """How far apart the stamps of a set may be; null where no key of the file says so."""
    max_wait_ms: Number | None
    """How long a set may wait."""
    bundle: Text | None = None
    """The topic on which each set leaves as one message; null without `bundle`."""
    sets: int
    """Sets published since the start."""
    rate_hz: Rate
    """Sets a second."""
    possible_hz: Rate
    """Sets a second that the slowest required input allows."""
    since_last_set_ms: Number | None
    """How long ago the last set left."""
    span_ms: Percentiles | None
    """Spans of the last sets."""
    span_without_offsets_ms: Number | None = None
    """The median span without the offsets of the file; null without offsets."""
    latency_ms: Percentiles | None
    """Latencies of the last sets."""
    nearest_ms: Percentiles | None = None
    """Spans of the nearest messages, whether they made a set or not."""
    last_sets: tuple[SetFigures, ...]
    """The last sets, the oldest first."""
    inputs: tuple[Input, ...]
    """The inputs, as in the file."""
    findings: tuple[Finding, ...]
    """At least one finding, the one that explains most first."""
    recent: tuple[Recent, ...]
    """The last sets (`set`: the stamp of each input's message) and drops (`drop`: the input's number, the stamp, the reason, whether it was `unneeded`), the oldest first."""  # noqa: E501  a row of a table

    def as_dict(self) -> dict[str, Any]:
        """Return what the document has of it as what json.dumps takes."""
        return dict(_of_group().dump_python(self, mode="json"))

    @property
    def explanation(self) -> Finding | None:
        """The finding that explains most, None if a relay sent none."""
        return self.findings[0] if self.findings else None

    @property
    def problems(self) -> list[Finding]:
        """The findings that something is wrong."""
        return [finding for finding in self.findings if finding.severity is not Level.OK]

    def problem_of(self, an_input: Input) -> Finding | None:
        """The finding about what is wrong with an input that explains most; None if nothing is wrong with it."""
        return next((finding for finding in self.problems if an_input.topic in (finding.topic, *finding.topics)), None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Trouble:
    """What is wrong now, by the findings that explain most; what has one cause is one, however many groups it hits."""

    code: Text
    """The code of the finding."""
    severity: Level
    """How bad it is at worst; `warn` or `error`."""
    text: Text
    """A sentence for people; its words may change with a version."""
    suggestion: Text | None
    """What to do about it."""
    groups: tuple[Text, ...]
    """The groups that it hits."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Status:
    """A relay at one moment."""

    relay: Relay
    """The relay as a whole."""
    headline: Text = ""
    """One sentence on all groups."""
    troubles: tuple[Trouble, ...] = ()
    """What is wrong, the worst first."""
    groups: tuple[Group, ...]
    """The groups, as in the file."""

    def as_json(self) -> bytes:
        """Return the document."""
        return _of_status().dump_json(self)

    def as_dict(self) -> dict[str, Any]:
        """Return the document as what json.dumps takes."""
        return dict(_of_status().dump_python(self, mode="json"))


def read_status(document: bytes) -> Status:
    """Return the status that a document holds. Raises NotAStatusError."""
    try:
        status = _of_status().validate_json(document)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"])) or "the document"
        raise NotAStatusError(printable(f"{where}: {first['msg']}")) from error
    _require_consistent(status)
    return status


def _require_consistent(status: Status) -> None:
    names = [group.name for group in status.groups]
    if len(set(names)) < len(names):
        raise NotAStatusError("groups: two have the same name")
    for index, group in enumerate(status.groups):
        if not group.inputs:
            raise NotAStatusError(f"groups.{index}.inputs: there is none")
        if not all(_fits(recent, len(group.inputs)) for recent in group.recent):
            raise NotAStatusError(f"groups.{index}.recent: a set or drop does not fit the inputs")


def _fits(recent: RecentSet | RecentDrop, n_inputs: int) -> bool:
    if isinstance(recent, RecentDrop):
        return 0 <= recent.input < n_inputs and recent.stamp in _STAMPS
    stamps = [stamp for stamp in recent.stamps if stamp is not None]
    return len(recent.stamps) == n_inputs and bool(stamps) and all(stamp in _STAMPS for stamp in stamps)


# Made when first needed, as a relay may never be asked.
@cache
def _of_status() -> TypeAdapter[Status]:
    return TypeAdapter(Status)


@cache
def _of_group() -> TypeAdapter[Group]:
    return TypeAdapter(Group)
