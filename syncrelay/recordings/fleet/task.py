"""What is done to each recording of many: the interface between a command and the fleet, and fingerprints of it."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from hashlib import blake2b
from pathlib import Path
from typing import Final, Protocol, TypeAlias

from syncrelay import own_version
from syncrelay.config import GroupConfig
from syncrelay.urls import redacted

JSON: TypeAlias = "dict[str, JSON] | list[JSON] | str | int | float | bool | None"
"""What json.dumps takes."""

PROBLEMS: Final = "problems"
"""The fact with what is wrong with a recording, a sentence each. It was done all the same; the exit code is 1."""

NOTES: Final = "notes"
"""The fact with what the user should know about a recording that was done, a sentence each. Nothing is wrong."""

# Options of groups and inputs that do not change which sets there are. `topics`, `trigger` and `restamp` count as
# resolved by the file, see _of_sets.
_NOT_OF_SETS: Final = frozenset(
    {"topics", "trigger", "restamp", "output_prefix", "lazy", "manifest", "bundle", "outputs"}
)
_NOT_OF_INPUTS: Final = frozenset({"output", "qos"})


@dataclass(frozen=True, slots=True)
class Source:
    """A recording: its absolute path or URL, and the name of its result.

    No other recording has this name, and any file system can hold it.
    """

    name: str
    place: str

    @property
    def shown(self) -> str:
        """The place for people and for the ledger: a URL without login and signature."""
        return redacted(self.place)


class Task(Protocol):
    """What is done to each recording. A frozen value that can be pickled: it goes to other processes and machines."""

    @property
    def fingerprint(self) -> str:
        """What decides the result of a recording, see fingerprint_of."""
        ...

    def run(self, source: Source, folder: Path) -> dict[str, JSON]:
        """Write the results of a recording into an empty folder, and return facts about it for the ledger.

        The same recording gives the same files, byte for byte. Raises SyncRelayError if the recording is at fault.
        """
        ...


def what_decides_sets(groups: Iterable[GroupConfig]) -> str:
    """Return all that decides which sets groups make of a recording.

    How the file is written makes no difference: comments, order, units, environment variables.
    """
    return _as_text(_of_sets(group) for group in groups)


def what_decides_outputs(groups: Iterable[GroupConfig]) -> str:
    """Return all that decides what a relay publishes for a recording: its sets, and the outputs' names and QoS."""
    return _as_text(
        [
            _of_sets(group),
            [(group.inputs.node.absolute(each.output), each.qos) for each in group.topics],
            group.bundle,
            group.options.manifest and group.inputs.node.absolute("~"),
        ]
        for group in groups
    )


def _of_sets(group: GroupConfig) -> dict[str, object]:
    options = {name: value for name, value in group.options if name not in _NOT_OF_SETS}
    topics = [
        {field.name: getattr(topic, field.name) for field in fields(topic) if field.name not in _NOT_OF_INPUTS}
        for topic in group.topics
    ]
    resolved = (group.inputs.names, group.restamp, group.trigger, group.ticks)
    return {"name": group.name, "options": options, "topics": topics, "resolved": resolved}


def _as_text(values: Iterable[object]) -> str:
    return json.dumps([*values], sort_keys=True, default=repr)


def fingerprint_of(command: str, *, config: str, options: Mapping[str, JSON]) -> str:
    """Return a line of words that decide a command's result: its name, syncrelay's version, hashes of file and options.

    `config` is from one of the functions above; `options` are those that change the result, not where it goes or how
    fast. The words in which two lines differ say what is different.
    """
    written = json.dumps(options, sort_keys=True)
    return f"{command} version:{own_version()} config:{short_hash(config)} options:{short_hash(written)}"


def short_hash(text: str) -> str:
    """Return a hash of a text that is short enough for people to compare."""
    return blake2b(text.encode(errors="surrogateescape"), digest_size=8).hexdigest()
