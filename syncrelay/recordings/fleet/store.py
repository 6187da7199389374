"""A folder of results in a store: the workers upload what they have done, and the command the ledger."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from syncrelay.errors import SyncRelayError
from syncrelay.output_files import begins_with, remove_from_store, sizes_in_store, upload
from syncrelay.recordings.fleet.content import ResultFile
from syncrelay.recordings.fleet.ledger import LEDGER
from syncrelay.urls import redacted

# A store cannot append to a file, so each time the whole ledger is uploaded. What it lacks after a kill is done again.
_EVERY_S: Final = 10.0
_LARGEST_LEDGER: Final = 1 << 32


@dataclass(slots=True)
class ResultStore:
    """The store behind a URL, which cannot be locked. All raise OutputError."""

    url: str
    _saved_at: float = field(default_factory=time.monotonic)

    def fetch_ledger(self, folder: Path) -> None:
        """Copy the ledger to a folder; raises SyncRelayError if the store holds something else."""
        content = begins_with(f"{self.url}/{LEDGER}", _LARGEST_LEDGER)
        if content:
            (folder / LEDGER).write_bytes(content)
        elif sizes_in_store(self.url):
            raise SyncRelayError(
                f"{redacted(self.url)}: holds files and no {LEDGER}: name an empty folder, or a new one"
            )

    def save_ledger(self, folder: Path, *, is_last: bool) -> None:
        """Upload the ledger, at most every 10 s if it is not the last time."""
        if is_last or time.monotonic() - self._saved_at > _EVERY_S:
            upload(folder / LEDGER, f"{self.url}/{LEDGER}")
            self._saved_at = time.monotonic()

    def put(self, name: str, folder: Path) -> None:
        """Upload a result in place of one that is there."""
        self.remove(name)
        upload(folder, f"{self.url}/{name}")

    def remove(self, name: str) -> None:
        """Remove a result."""
        remove_from_store(f"{self.url}/{name}")

    def has(self, name: str, files: Mapping[str, ResultFile]) -> bool:
        """Tell whether the store has exactly these files of a result, by their sizes."""
        return sizes_in_store(f"{self.url}/{name}") == {path: file.size for path, file in files.items()}
