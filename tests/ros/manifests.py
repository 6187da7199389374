"""Manifests as their readers see them: by the keys that docs/reference/manifest.md names, deserialized by rosbags."""

from collections.abc import Sequence
from typing import Any, NamedTuple

from syncrelay.dataflow.manifest import Note
from tests.ros.cdr_messages import NS_PER_SECOND, STORE

MANIFEST_TYPE = "diagnostic_msgs/msg/DiagnosticArray"
OK, WARN, ERROR, STALE = range(4)


class Member(NamedTuple):
    """A message of a set, as its manifest is to tell of it."""

    stamp: int
    original_stamp: int
    received: int
    sequence: int
    why_not: str = ""


def note(number: int, members: Sequence[Member | None], *, common: int | None = None, latency: int = 0) -> Note:
    """Give what the manifest of a set is written from."""
    there = [each for each in members if each is not None]
    return Note(
        number=number,
        latency=latency,
        common=common,
        values=[value for each in there for value in (each.stamp, each.original_stamp, each.received, each.sequence)],
        missing=tuple(index for index, each in enumerate(members) if each is None),
        unpublished={index: each.why_not for index, each in enumerate(members) if each is not None and each.why_not},
    )


class ToldInput(NamedTuple):
    """What is told of an input; what stands among its values is None where it has none."""

    level: int
    output: str
    input: str
    message: str
    sequence: int | None = None
    stamp: int | None = None
    original_stamp: int | None = None
    received: int | None = None


class Told(NamedTuple):
    """What a manifest tells; times in nanoseconds."""

    stamp: int
    level: int
    group: str
    message: str
    node: str
    number: int
    missing: int
    span: int
    latency: int
    common_stamp: int | None
    policy: str
    inputs: tuple[ToldInput, ...]
    bundle: str | None = None
    bundle_sequence: str | None = None


def read(payload: bytes) -> Told:
    message: Any = STORE.deserialize_cdr(payload, MANIFEST_TYPE)
    stamp, (of_set, *inputs) = message.header.stamp, message.status
    values = {each.key: each.value for each in of_set.values}
    assert values.pop("version") == "1"
    common = values.pop("common_stamp_ns")
    return Told(
        stamp=stamp.sec * NS_PER_SECOND + stamp.nanosec,
        level=of_set.level,
        group=of_set.name,
        message=of_set.message,
        node=of_set.hardware_id,
        number=int(values.pop("set")),
        missing=int(values.pop("missing")),
        span=int(values.pop("span_ns")),
        latency=int(values.pop("latency_ns")),
        common_stamp=int(common) if common else None,
        inputs=tuple(map(_input, inputs)),
        **values,
    )


def _input(status) -> ToldInput:
    values = {each.key.removesuffix("_ns"): int(each.value) for each in status.values}
    return ToldInput(status.level, status.name, status.hardware_id, status.message, **values)
