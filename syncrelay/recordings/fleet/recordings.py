"""From words of the command line to recordings: files, folders of them, patterns, lists and URLs."""

import os
import re
from collections.abc import Iterator, Sequence
from glob import glob, has_magic
from hashlib import blake2b
from pathlib import Path
from typing import Final

from syncrelay.errors import BagError
from syncrelay.recording_files import METADATA, is_recording_name
from syncrelay.recordings.bag.storage import find, is_url
from syncrelay.recordings.fleet.task import Source
from syncrelay.urls import redacted

_EXPECTED: Final = "expected files that end in .mcap, .db3 or .bag, compressed or not"
_LIST: Final = "@"
# In bytes of UTF-8: with the hash, a name stays below the 255 bytes that file systems allow.
_LONGEST_STEM: Final = 100
_HASH_BYTES: Final = 8
# Programs that read a folder of Parquet files as one table skip names that begin with `_` or `.`.
_RESULT_NAME: Final = re.compile(rf"(?![._])[^/\0]*-[0-9a-f]{{{2 * _HASH_BYTES}}}", re.DOTALL)
_MOST_LISTED_BYTES: Final = 100_000_000


def find_sources(words: Sequence[str], *, into: Path | str) -> list[Source]:
    """Return the recordings that words name, each once, except results of an earlier command below `into`.

    A word is a file, a folder, a pattern such as `day*/*.mcap` or `**/*.db3`, a URL, or `@FILE`, a file with one such
    word on each line. A rosbag2 folder is one recording; any other folder is searched to any depth. Raises BagError
    for a word that names no recording.
    """
    folder = str(into)
    own = f"{folder if is_url(folder) else os.path.abspath(folder)}/"  # noqa: PTH100  as in _places: links keep their names
    found: dict[str, Source] = {}
    for word in words:
        places = _listed(word[1:]) if word.startswith(_LIST) else _places(word)
        others = [place for place in places if not place.startswith(own)]
        if not others:
            raise BagError(f"{word}: names only results in {into}, which is where results go")
        found.update((place, Source(result_name(place), place)) for place in others)
    return list(found.values())


def names_recordings(word: str) -> bool:
    """Tell whether a word names recordings, for find_sources, rather than a topic."""
    return word.startswith(_LIST) or is_url(word) or has_magic(word) or "." in word or os.path.lexists(word)


def result_name(place: str) -> str:
    """Return the file name of a recording's result, which depends only on the recording's absolute path or URL.

    It begins with the recording's own name, shortened and without unusual characters, and ends with a hash of the
    whole path, because recordings in several folders may have the same name.
    """
    # A URL that is signed again is the same recording.
    place = redacted(place)
    own = place.rstrip("/").rpartition("/")[2]
    stem = own.partition(".")[0] or own
    plain = "".join(each if each.isalnum() or each in "-_" else "_" for each in stem).lstrip("_")
    short = plain.encode(errors="replace")[:_LONGEST_STEM].decode(errors="ignore")
    return f"{short}-{blake2b(os.fsencode(place), digest_size=_HASH_BYTES).hexdigest()}"


def is_result_name(name: str) -> bool:
    """Tell whether a name has the form that result_name gives."""
    return _RESULT_NAME.fullmatch(name) is not None


def _listed(name: str) -> Iterator[str]:
    """Yield the recordings of a list file: a word on each line; lines that begin with # are comments."""
    try:
        with Path(name).open("rb") as file:
            content = file.read(_MOST_LISTED_BYTES + 1)
    except OSError as error:
        raise BagError(f"{name}: the list of recordings cannot be read: {error.strerror}") from error
    if len(content) > _MOST_LISTED_BYTES:
        raise BagError(f"{name}: larger than {_MOST_LISTED_BYTES // 1_000_000} MB: is this a list of recordings?")
    lines = [line.strip() for line in content.split(b"\n")]
    words = [os.fsdecode(line) for line in lines if line and not line.startswith(b"#")]
    if not words:
        raise BagError(f"{name}: lists no recording, expected one on each line")
    for word in words:
        yield from _places(word)


def _places(word: str) -> list[str]:
    """Return the absolute paths of the recordings that a word names, or their URLs."""
    if is_url(word):
        return find(word)
    try:
        found = _matching(word) if has_magic(word) and not os.path.lexists(word) else _named(Path(word))
    except OSError as error:
        raise BagError(f"{word}: cannot be read: {error.strerror}") from error
    return [os.path.abspath(path) for path in found]  # noqa: PTH100  a link keeps its name, as a folder of links has them


def _matching(pattern: str) -> list[Path]:
    # Path.glob refuses absolute patterns, and finds hidden files, which a shell does not.
    matches = [Path(each) for each in sorted(glob(pattern, recursive=True))]  # noqa: PTH207
    found = [path for match in matches for path in (_inside(match) if match.is_dir() else _if_recording(match))]
    if not found:
        what = f"none of the {len(matches)} files and folders is a recording" if matches else "nothing there"
        raise BagError(f"{pattern}: {what}, {_EXPECTED}")
    return found


def _named(path: Path) -> list[Path]:
    if path.name == METADATA and path.is_file():
        path = path.parent
    if not path.is_dir():
        if not path.exists():
            raise BagError(f"{path}: no such file or folder")
        # Its content shows what it is, not its name.
        return [path]
    found = list(_inside(path))
    if not found:
        raise BagError(f"{path}: holds no recording, {_EXPECTED}")
    return found


def _inside(folder: Path) -> Iterator[Path]:
    """Yield the folder if it is one recording, otherwise the recordings in it."""
    entries = sorted(folder.iterdir())
    files = [entry for entry in entries if not entry.is_dir()]
    recordings = [path for file in files for path in _if_recording(file)]
    if recordings and _is_rosbag2(folder, files, recordings):
        yield folder
        return
    yield from recordings
    for entry in entries:
        # A link to a parent folder would never end.
        if entry.is_dir() and not entry.is_symlink() and not entry.name.startswith("."):
            yield from _inside(entry)


def _is_rosbag2(folder: Path, files: Sequence[Path], recordings: Sequence[Path]) -> bool:
    """Tell whether a folder is one rosbag2 recording; after a crash of the recorder it may lack its metadata."""
    split = re.compile(re.escape(folder.name) + r"_\d+\..*", re.DOTALL)
    return any(file.name == METADATA for file in files) or all(split.fullmatch(file.name) for file in recordings)


def _if_recording(path: Path) -> list[Path]:
    return [path] if is_recording_name(path.name) else []
