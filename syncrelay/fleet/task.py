"""What is done to each recording of many, and to which: the interface between a command and the fleet."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import blake2b
from pathlib import Path
from typing import Final, Protocol, TypeAlias

from syncrelay import own_version
from syncrelay.bag.attempts import redacted
from syncrelay.config import Config
from syncrelay.config.document import plain

JSON: TypeAlias = "dict[str, JSON] | list[JSON] | str | int | float | bool | None"
"""What json.dumps takes."""

PROBLEMS: Final = "problems"
"""The fact that lists, in sentences, what is wrong with a recording that was done all the same; the exit code is 1."""


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


def text_of(config: Config) -> str:
    """Return what the files of a configuration say: their text, and all values with environment variables filled in."""
    return json.dumps([*(source.text for source in config.sources), plain(config.names.document.root)], default=str)


def fingerprint_of(command: str, *, config: str, options: Mapping[str, JSON]) -> str:
    """Return a line of what decides a command's result: its name, syncrelay's version, the file's text, its options.

    `config` is what text_of gives, `options` what else changes the result: not where it goes, nor how fast. Two
    lines are equal if all of these are; the words of a line tell which one differs.
    """
    written = json.dumps(options, sort_keys=True)
    return f"{command} version:{own_version()} config:{_short(config)} options:{_short(written)}"


def _short(text: str) -> str:
    return blake2b(text.encode(errors="surrogateescape"), digest_size=8).hexdigest()
