"""What is done to each recording of many, and to which: the interface between a command and the fleet."""

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
"""The fact that lists, in sentences, what is wrong with a recording that was done all the same; the exit code is 1."""

NOTES: Final = "notes"
"""The fact that lists, in sentences, what its user should know of a recording that was done, and that is not wrong."""

# Options that decide no set: what of them does is resolved, and beside them.
_NOT_OF_SETS: Final = frozenset({"topics", "trigger", "restamp", "output_prefix", "lazy", "manifest"})
_NOT_OF_INPUTS: Final = frozenset({"output", "qos"})


@dataclass(frozen=True, slots=True)
class Source:
    """A recording: what open_recording takes, and a name for its result that no other path has and any folder can hold.

    `words` are absolute paths, or URLs.
    """

    name: str
    words: tuple[str, ...]

    @property
    def shown(self) -> tuple[str, ...]:
        """The words as people and ledgers may see them: URLs without logins and signatures."""
        return tuple(map(redacted, self.words))


class Task(Protocol):
    """What is done to each recording. A frozen value that can be pickled: it goes to other processes and machines."""

    def fingerprint(self) -> str:
        """Return what decides the result of a recording, as fingerprint_of gives it."""
        ...

    def run(self, source: Source, folder: Path) -> dict[str, JSON]:
        """Write the results of a recording into an empty folder, and return facts about it for the ledger.

        The same recording gives the same files, byte for byte. Raises SyncRelayError where the recording is at fault.
        """
        ...


def what_decides_sets(groups: Iterable[GroupConfig]) -> str:
    """Return what of groups decides which sets a recording gives them: all their values but those named here.

    How a file is written is none of it: comments, order, units, where a value comes from.
    """
    return _as_text(_of_sets(group) for group in groups)


def what_decides_outputs(groups: Iterable[GroupConfig]) -> str:
    """Return what of groups decides the topics that a relay publishes of a recording: their sets, names and QoS."""
    return _as_text(
        [
            _of_sets(group),
            [(group.inputs.node.absolute(each.output), each.qos) for each in group.topics],
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
    """Return a line of what decides a command's result: its name, syncrelay's version, the file's values, its options.

    `config` is what one of the functions above gives, `options` what else changes the result: not where it goes, nor
    how fast. Two lines are equal if all of these are; the words of a line tell which one differs.
    """
    written = json.dumps(options, sort_keys=True)
    return f"{command} version:{own_version()} config:{short_hash(config)} options:{short_hash(written)}"


def short_hash(text: str) -> str:
    """Return a hash of a text that people can compare by eye."""
    return blake2b(text.encode(errors="surrogateescape"), digest_size=8).hexdigest()
