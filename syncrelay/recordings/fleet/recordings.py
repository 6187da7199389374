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
# Of UTF-8: with the hash behind it, a name stays below the 255 bytes that file systems allow.
_LONGEST_STEM: Final = 100
_HASH_BYTES: Final = 8
# What reads a folder of Parquet files as one table skips names that begin with `_` or `.`.
_RESULT_NAME: Final = re.compile(rf"(?![._])[^/\0]*-[0-9a-f]{{{2 * _HASH_BYTES}}}", re.DOTALL)
_MOST_LISTED_BYTES: Final = 100_000_000


def find_sources(words: Sequence[str], *, into: Path) -> list[Source]:
    """Return the recordings that words name, each once, but for those below a folder that results go into.

    A word is a file, a folder, a pattern such as `day*/*.mcap` or `**/*.db3`, a URL, or `@FILE`, which has such words
    on its lines. A rosbag2 folder is one recording; any other folder is searched for recordings to any depth. Raises
    BagError for a word that names none.
    """
    own = f"{os.path.abspath(into)}/"  # noqa: PTH100  as the places are made
    found: dict[str, Source] = {}
    for word in words:
        places = _listed(word[1:]) if word.startswith(_LIST) else _places(word)
        others = [place for place in places if not place.startswith(own)]
        if not others:
            raise BagError(f"{word}: names only results in {into}, which is where results go")
        found.update((place, Source(result_name(place), (place,))) for place in others)
    return list(found.values())


def names_recordings(word: str) -> bool:
    """Tell whether a word means recordings and no topic: what find_sources takes, and is there or looks like a file."""
    return word.startswith(_LIST) or is_url(word) or has_magic(word) or "." in word or os.path.lexists(word)


def result_name(place: str) -> str:
    """Return a name for the result of a recording by its absolute path or URL: a file name, always the same for it.

    It begins with the recording's own name, as far as any folder can hold that and without `_` in front, and ends with
    a hash of the whole path: recordings of one name in several folders stay apart.
    """
    # Who signs a URL anew means the same recording.
    place = redacted(place)
    own = place.rstrip("/").rpartition("/")[2]
    stem = own.partition(".")[0] or own
    plain = "".join(each if each.isalnum() or each in "-_" else "_" for each in stem).lstrip("_")
    short = plain.encode(errors="replace")[:_LONGEST_STEM].decode(errors="ignore")
    return f"{short}-{blake2b(os.fsencode(place), digest_size=_HASH_BYTES).hexdigest()}"


def is_result_name(name: str) -> bool:
    """Tell whether this is a name that result_name gives."""
    return _RESULT_NAME.fullmatch(name) is not None


def _listed(name: str) -> Iterator[str]:
    """Yield the recordings of a list: one word a line, lines that begin with # are comments."""
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
    # As a shell does it: Path.glob takes no absolute pattern, and hidden files.
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
        # Whatever it is called: it is told by its content.
        return [path]
    found = list(_inside(path))
    if not found:
        raise BagError(f"{path}: holds no recording, {_EXPECTED}")
    return found


def _inside(folder: Path) -> Iterator[Path]:
    """Yield the recordings of a folder: itself, or the files and folders in it that are."""
    entries = sorted(folder.iterdir())
    files = [entry for entry in entries if not entry.is_dir()]
    recordings = [path for file in files for path in _if_recording(file)]
    if recordings and _is_rosbag2(folder, files, recordings):
        yield folder
        return
    yield from recordings
    for entry in entries:
        # A link to a folder above would have no end.
        if entry.is_dir() and not entry.is_symlink() and not entry.name.startswith("."):
            yield from _inside(entry)


def _is_rosbag2(folder: Path, files: Sequence[Path], recordings: Sequence[Path]) -> bool:
    """Tell a recording of rosbag2, which a crash may have left without its metadata, from loose ones."""
    split = re.compile(re.escape(folder.name) + r"_\d+\..*", re.DOTALL)
    return any(file.name == METADATA for file in files) or all(split.fullmatch(file.name) for file in recordings)


def _if_recording(path: Path) -> list[Path]:
    return [path] if is_recording_name(path.name) else []
