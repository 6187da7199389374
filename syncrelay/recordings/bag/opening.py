"""From paths and URLs to a recording: files by what they begin with, folders, splits, files compressed as a whole."""

import bz2
import gzip
import heapq
import zlib
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack
from itertools import chain, pairwise
from operator import itemgetter
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, TypeAlias

import zstandard

from syncrelay.config.wording import counted
from syncrelay.errors import NO_SPACE, BagError, StorageError
from syncrelay.recording_files import METADATA, scheme_of
from syncrelay.recordings.bag import mcap_file, mcap_index, ros1_file, sqlite_file
from syncrelay.recordings.bag.effort import TOO_MUCH, room_for
from syncrelay.recordings.bag.listing import files_meant, listed_in_metadata
from syncrelay.recordings.bag.recording import Channel, RawMessage, Recording, batched, filled
from syncrelay.recordings.bag.remote_file import RemoteFile
from syncrelay.recordings.bag.sources import LocalFile, NoIndexError
from syncrelay.urls import LOCAL, file_system, redacted

Tell: TypeAlias = Callable[[str], object]
"""Called with a sentence that is worth a remark and is no fault."""

_OPENERS: Final[Mapping[bytes, Callable[[Path, str], Recording]]] = {
    mcap_index.MAGIC: lambda path, name: mcap_file.open_mcap(LocalFile(path), name),
    sqlite_file.MAGIC: sqlite_file.SqliteFile,
    ros1_file.MAGIC: ros1_file.Ros1File,
}


_DECOMPRESSORS: Final[Mapping[bytes, Callable[[Path], Any]]] = {
    b"BZh": bz2.open,
    b"\x28\xb5\x2f\xfd": lambda path: zstandard.open(path, "rb"),
    b"\x1f\x8b": gzip.open,
}
_LONGEST_MAGIC: Final = 16
_PIECE: Final = 1_000_000


def open_recording(paths: Sequence[str], *, tell: Tell = lambda _: None) -> Recording:
    """Open files and folders, given by paths or URLs, as one recording.

    Files that cannot be read, or that metadata.yaml lists and are missing, are faults of the recording. `tell` is
    called before a whole download. Raises BagError if none can be read, StorageError if one cannot be reached.
    """
    with ExitStack() as opened:
        files: list[Recording] = []
        unreadable: list[BagError] = []
        faults: list[str] = []
        listed = [listed_in_metadata(path, faults) for path in paths]
        for path in files_meant(paths):
            try:
                if isinstance(path, str):
                    file = _open_remote(path, opened, faults, tell)
                else:
                    file = _open(path, str(path), opened, faults)
            except StorageError:
                raise
            except BagError as error:
                unreadable.append(error)
                continue
            opened.callback(file.close)
            files.append(file)
        if not files:
            raise unreadable[0]
        topics = [each.topics for each in listed if each is not None]
        counts = sum(map(Counter, topics), Counter()) if None not in listed else {}
        name = redacted(paths[0])
        return Files(name, files, opened.pop_all(), faults=[*map(str, unreadable), *faults], counts=counts)


class Files:
    """Several files as one recording; see Recording."""

    def __init__(
        self,
        name: str,
        files: Sequence[Recording],
        opened: ExitStack,
        *,
        faults: Sequence[str],
        counts: Mapping[str, int],
    ) -> None:
        """Read from files that `opened` closes; `faults` are those of files that could not be opened.

        `counts` is the expected number of messages of each topic, empty if it is not known.
        """
        self._name = name
        self._files = sorted(files, key=lambda file: file.begin)
        self._opened = opened
        self._faults = list(faults)
        self._counts = counts
        self.channels = tuple(channel for file in self._files for channel in file.channels)
        self.size = sum(file.size for file in files)
        self.begin = min((file.begin for file in self._files if file.end), default=0)
        self.end = max((file.end for file in self._files), default=0)

    @property
    def faults(self) -> list[str]:
        """See Recording."""
        return [*self._faults, *(fault for file in self._files for fault in file.faults)]

    @property
    def position(self) -> int:
        """See Recording."""
        return sum(file.position for file in self._files)

    def batches(self, wanted: Collection[Channel]) -> Iterator[list[RawMessage]]:
        """See Recording."""
        parts = [file.batches(wanted) for file in self._files]
        if any(earlier.end > later.begin for earlier, later in pairwise(self._files)):
            found = batched(heapq.merge(*map(chain.from_iterable, parts), key=itemgetter(1)))
        else:
            found = filled(chain.from_iterable(parts))
        return self._counted(found, wanted) if self._counts else found

    def _counted(self, found: Iterator[list[RawMessage]], wanted: Collection[Channel]) -> Iterator[list[RawMessage]]:
        """Pass on messages; too few of them, without a fault that explains it, become a fault."""
        count = 0
        for batch in found:
            count += len(batch)
            yield batch
        among = frozenset(wanted)
        topics = {channel.topic for channel in among}
        if self.faults or any(each.topic in topics and each not in among for each in self.channels):
            return
        expected = sum(self._counts.get(topic, 0) for topic in topics)
        if count < expected:
            missing = counted(expected - count, "message")
            said = f"{METADATA} counts {expected} of the topics that were read, found {count}"
            self._faults.append(f"{self._name}: {missing} missing: {said}")

    def close(self) -> None:
        """See Recording."""
        self._opened.close()


def _open_remote(url: str, opened: ExitStack, faults: list[str], tell: Tell) -> Recording:
    """Open a file behind a URL by ranges if possible; otherwise download it once."""
    if scheme_of(url) in LOCAL:
        return _open(Path(file_system(url)[1]), url, opened, faults)
    remote = RemoteFile(url)
    opened.callback(remote.close)
    why = "its format is read from a file of this machine"
    if not remote.has_ranges:
        why = "its server cannot send parts of it"
    elif remote.read(0, _LONGEST_MAGIC).startswith(mcap_index.MAGIC):
        try:
            return mcap_file.open_mcap(remote, remote.name)
        except NoIndexError:
            why = "it has no index that can be trusted"
    copy = _temporary(remote.name, "copy it to", opened) / "recording"
    remote.download(copy)
    tell(f"{remote.name}: copied here as a whole ({copy.stat().st_size:,} bytes): {why}")
    return _open(copy, remote.name, opened, faults)


def _open(path: Path, name: str, opened: ExitStack, faults: list[str]) -> Recording:
    """Open a file by its first bytes; one that is compressed as a whole is decompressed into a temporary file."""
    magic = _magic(path)
    for begin, decompressor in _DECOMPRESSORS.items():
        if magic.startswith(begin):
            content, found = _decompressed(path, name, decompressor, opened)
            if found and not content.stat().st_size:
                raise BagError(found[0])
            faults += found
            return _open_plain(content, _magic(content), name)
    return _open_plain(path, magic, name)


def _open_plain(path: Path, magic: bytes, name: str) -> Recording:
    for begin, opener in _OPENERS.items():
        if magic.startswith(begin):
            return opener(path, name)
    if not magic:
        raise BagError(f"{name}: is empty")
    if magic.startswith(b"#ROSBAG V"):
        raise BagError(f"{name}: is a bag of a format other than 2.0: convert it with `rosbag migrate`")
    raise BagError(f"{name}: is not a recording, expected MCAP, a sqlite3 file of rosbag2 or a ROS 1 bag")


def _magic(path: Path) -> bytes:
    try:
        if not path.is_file():
            raise BagError(f"{path}: is not a regular file, as a recording has to be")
        with path.open("rb") as file:
            return file.read(_LONGEST_MAGIC)
    except OSError as error:
        raise BagError(f"{path}: cannot be read: {error.strerror}") from error


def _temporary(name: str, purpose: str, opened: ExitStack) -> Path:
    try:
        return Path(opened.enter_context(TemporaryDirectory(prefix="syncrelay-")))
    except OSError as error:
        raise BagError(
            f"{name}: no temporary folder to {purpose}, set TMPDIR to one that can be written: {error.strerror}"
        ) from error


def _decompressed(
    path: Path, name: str, decompressor: Callable[[Path], Any], opened: ExitStack
) -> tuple[Path, list[str]]:
    """Return a temporary file with the content, and sentences on what is wrong with it."""
    folder = _temporary(name, "decompress it in", opened)
    content = folder / path.stem
    room = room_for(path.stat().st_size)
    try:
        # Closing writes what is still buffered.
        with decompressor(path) as packed, content.open("wb") as plain:
            while piece := packed.read(_PIECE):
                if len(piece) > room:
                    return content, [f"{name}: {TOO_MUCH}; read up to there: decompress it yourself to have all of it"]
                room -= plain.write(piece)
    except (EOFError, OSError, zlib.error, zstandard.ZstdError) as error:
        if isinstance(error, OSError) and error.errno in NO_SPACE:
            raise BagError(f"{name}: no space in {folder} to decompress it, set TMPDIR to another folder") from error
        return content, [f"{name}: cut off or damaged; read up to there: {error}"]
    return content, []
