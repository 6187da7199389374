"""Sets of recordings as tables. They are read as they are asked for, so memory does not grow with the recording."""

import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from os import PathLike, fspath
from typing import Final, NamedTuple, TypeVar

import pyarrow as pa

from syncrelay.config import Config, load
from syncrelay.config.wording import all_of, did_you_mean
from syncrelay.errors import BagError, UsageError
from syncrelay.recordings.bag import open_recording
from syncrelay.recordings.bag.bindings import GroupBinding, bind, full_name
from syncrelay.recordings.bag.replay import Listener, Replay
from syncrelay.recordings.datasets.images import ImageFormat
from syncrelay.recordings.datasets.tables import Content, Fields, SetTable

T = TypeVar("T")

MOST_BYTES: Final = 32_000_000
"""A table is made of this many bytes of messages."""

# A table of small messages is limited by their number.
_MOST_SETS: Final = 20_000


class Part(NamedTuple):
    """A table of consecutive sets of one group."""

    group: SetTable
    table: pa.Table


class SetsOf:
    """The sets that leave in a replay, as tables of each group."""

    def __init__(self, bindings: Sequence[GroupBinding], content: Content, *, name: str) -> None:
        """`name` is the value of the column `recording`.

        Raises BagError for a field that a recorded type does not have.
        """
        self.groups: Final = tuple(SetTable(binding, content, recording=name) for binding in bindings)
        self.listeners: Final[tuple[Listener, ...]] = tuple(group.take for group in self.groups)
        """The listeners of the replay."""

    def parts(self, steps: Iterable[None], *, most_bytes: int = MOST_BYTES) -> Iterator[Part]:
        """Yield tables of all groups while the steps of a replay run; the sets of a group come in order."""
        for _ in steps:
            is_full = sum(group.bytes for group in self.groups) >= most_bytes
            for group in self.groups:
                if group.gathered and (is_full or group.gathered >= _MOST_SETS):
                    yield Part(group, group.table())
        for group in self.groups:
            if group.gathered:
                yield Part(group, group.table())

    def faults(self) -> list[str]:
        """Return a sentence for each input of which messages could not be decoded."""
        return [sentence for group in self.groups for sentence in group.undecodable()]


def read_sets(
    recordings: str | PathLike[str] | Sequence[str | PathLike[str]],
    config: str | PathLike[str] | Config,
    *,
    group: str | None = None,
    fields: Fields | None = None,
    images: ImageFormat | Mapping[str, ImageFormat] | None = None,
    raw: bool = False,
    most_bytes: int = MOST_BYTES,
) -> Iterator[pa.RecordBatch]:
    """Yield the sets of recordings as record batches; a row is a set, in the order in which sets leave.

    Each of `recordings` (a file, a rosbag2 folder or a URL) is matched by itself, one after another. `config` is a
    path, or the result of `syncrelay.config.load`; `group` names one of its groups, and may be left out if it has one.
    `fields` maps an input to dotted paths of its fields; an input that is not in it has all fields. `images` is "png"
    or "jpeg" for all images, or maps an input to one of them; other images keep their raw pixels. With `raw` each
    message is its CDR bytes. A batch holds the sets of about `most_bytes` bytes of messages. The columns are those of
    syncrelay.recordings.datasets.tables. If a part of a recording is missing or cannot be read, this warns after the
    rest has been read.

    Raises ConfigError for a faulty file, BagError for a recording that cannot be read or lacks a required topic, and
    UsageError for a group or an input that the file does not have.
    """
    loaded = config if isinstance(config, Config) else load(fspath(config))
    chosen = _chosen(loaded, group)
    by_input, others = (images, None) if isinstance(images, Mapping) else ({}, images)
    content = Content(resolved(fields or {}, loaded), resolved(by_input, loaded), others, raw)
    words = [recordings] if isinstance(recordings, str | PathLike) else recordings
    for word in [fspath(each) for each in words]:
        with closing(open_recording([word])) as recording:
            (binding,) = (each for each in bind(loaded, recording) if each.group.name == chosen)
            require_complete([binding])
            sets = SetsOf([binding], content, name=word)
            steps = Replay(recording, [binding], listeners=sets.listeners).steps()
            for part in sets.parts(steps, most_bytes=most_bytes):
                yield from part.table.combine_chunks().to_batches()
            for fault in recording.faults:
                warnings.warn(fault, stacklevel=2)


def resolved(by_input: Mapping[str, T], config: Config) -> dict[str, T]:
    """Return a mapping of inputs with their full names as keys; raises UsageError for an input that no group has."""
    topics = [full_name(topic.topic, config) for group in config.groups for topic in group.topics]
    found: dict[str, T] = {}
    for named, value in by_input.items():
        name = full_name(named, config)
        if name not in topics:
            raise UsageError(f"{named} is no input of the file{did_you_mean(named, topics)}; it has {all_of(topics)}")
        found[name] = value
    return found


def require_complete(bindings: Sequence[GroupBinding]) -> None:
    """Raise BagError if the recording lacks a required input, so that there can be no sets."""
    lacking = [problem for binding in bindings if not binding.is_complete for problem in binding.problems]
    if lacking:
        raise BagError("\n".join(lacking))


def _chosen(config: Config, group: str | None) -> str:
    names = [each.name for each in config.groups]
    if group is None and len(names) > 1:
        raise UsageError(f"the file has the groups {all_of(names)}: say which one, as group={names[0]!r}")
    if group is not None and group not in names:
        raise UsageError(f"the file has no group {group}{did_you_mean(group, names)}; it has {all_of(names)}")
    return group or names[0]
