"""Which files a word of the command line means, and what metadata.yaml says about their folder."""

from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path, PurePosixPath
from typing import NamedTuple

from syncrelay.config.wording import did_you_mean
from syncrelay.errors import BagError, StorageError
from syncrelay.recording_files import METADATA, SUFFIXES, is_recording_name
from syncrelay.recordings.bag.metadata import LARGEST, Metadata, parse_metadata
from syncrelay.recordings.bag.remote_file import RemoteFile
from syncrelay.recordings.bag.storage import files_of, is_url, metadata_of, natural
from syncrelay.urls import redacted


def files_meant(named: Sequence[str]) -> Iterator[Path | str]:
    """Yield the paths of local files, and URLs."""
    for name in named:
        if is_url(name):
            yield from files_of(name)
            continue
        try:
            yield from _files_of(Path(name), named)
        except OSError as error:
            raise BagError(f"{name}: cannot be read: {error.strerror}") from error


def local_files(word: str) -> list[Path]:
    """Return the local files that open_recording would read; raises BagError if there are none."""
    return [file for file in files_meant([word]) if isinstance(file, Path)]


def listed_in_metadata(word: str, faults: list[str]) -> Metadata | None:
    """Return the metadata.yaml of the folder that a word means, and add to `faults` which of its files are missing.

    None if there is no metadata.yaml, or the word names a single file.
    """
    name = redacted(word)
    try:
        found = _metadata(word)
        metadata = None if found is None else parse_metadata(found.content)
    except StorageError:
        raise
    except (BagError, OSError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        faults.append(f"{name}: {METADATA} {why}: missing files would not be noticed")
        return None
    if found is not None and metadata is not None and (missing := metadata.missing(found.files)):
        faults.append(f"{name}: {missing}")
    return metadata


class _Found(NamedTuple):
    """The first LARGEST + 1 bytes of a metadata.yaml, and the names of the files beside it."""

    content: bytes
    files: Sequence[str]


def _metadata(word: str) -> _Found | None:
    if is_url(word):
        url = metadata_of(word)
        if url is None:
            return None
        with closing(RemoteFile(url)) as remote:
            content = remote.read(0, min(LARGEST + 1, remote.size))
        return _Found(content, [PurePosixPath(each).name for each in files_of(word)])
    folder = Path(word).parent if Path(word).name == METADATA else Path(word)
    if not (folder / METADATA).is_file():
        return None
    with (folder / METADATA).open("rb") as file:
        content = file.read(LARGEST + 1)
    return _Found(content, [each.name for each in folder.iterdir() if is_recording_name(each.name)])


def is_recording(word: str) -> bool:
    """Tell whether a word means a recording and not a topic, without fetching anything.

    A recording exists, is a URL, or has a dot, which no topic has.
    """
    if is_url(word):
        return True
    path = Path(word)
    try:
        return "." in path.name or path.is_file() or (path.is_dir() and bool(_files_in(path)))
    except (OSError, BagError):
        return False


def _files_of(path: Path, named: Sequence[str]) -> list[Path]:
    if path.name == METADATA and path.is_file():
        path = path.parent
    if path.is_dir():
        return _files_in(path)
    if path.exists():
        return [path]
    raise BagError(f"{path}: no such file or folder{_similar(path, named)}")


def _files_in(folder: Path) -> list[Path]:
    files = sorted(
        (path for path in folder.iterdir() if is_recording_name(path.name)), key=lambda path: natural(path.name)
    )
    if not files:
        raise BagError(f"{folder}: holds no recording, expected files that end in {', '.join(SUFFIXES)}")
    return files


def _similar(path: Path, named: Sequence[str]) -> str:
    """Return "did you mean" for the most similar recording beside a path that is not named already."""
    try:
        others = set(path.parent.iterdir()).difference(map(Path, named))
        beside = [each.name for each in sorted(others) if each.is_dir() or is_recording_name(each.name)]
    except OSError:
        return ""
    return did_you_mean(path.name, beside)
