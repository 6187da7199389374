"""Recordings behind URLs: found by folder and pattern, as far as their store lists what it has."""

import re
from typing import Any, Final

from syncrelay.errors import BagError
from syncrelay.recording_files import METADATA, is_recording_name, scheme_of
from syncrelay.urls import SERVERS, file_system, redacted, tried

_PATTERN: Final = re.compile(r"[*?\[]")


def is_url(word: str) -> bool:
    """Tell whether a word is a URL and not a path."""
    return bool(scheme_of(word))


def natural(name: str) -> list[tuple[int, str]]:
    """Return a sort key by which numbers in names count: _9 before _10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)]


def find(word: str) -> list[str]:
    """Return the recordings that a word means, sorted by name; a path, and a URL of a server, means itself.

    In a store a pattern means what matches it, and a folder all recordings below it; a rosbag2 folder is one recording.
    Raises BagError if there is none.
    """
    if not _is_listed(word):
        return [word]
    files, path = file_system(word)
    kinds = _kinds(word, files, path)
    found = {url for url, kind in kinds.items() if kind == "file"}
    below = {url for folder in kinds.keys() - found for url in _below(files, folder)}
    folders = {_folder(url) for url in found | below if _name(url) == METADATA}
    known = {url for url in below if is_recording_name(_name(url))}
    own = files.unstrip_protocol(path)
    known |= {url for url in found if _name(url) != METADATA and (is_recording_name(_name(url)) or url == own)}
    recordings = {_folder(url) if _folder(url) in folders and url in below else url for url in known}
    recordings |= {_folder(url) for url in found if _name(url) == METADATA}
    if not recordings:
        raise BagError(f"{redacted(word)}: holds no recording: check the URL")
    return sorted(recordings, key=natural)


def files_of(word: str) -> list[str]:
    """Return the files of one recording as a local path means them: a file, or all that are in a folder."""
    if not _is_listed(word):
        return [word]
    files, path = file_system(word)
    found: list[str] = []
    for url, kind in _kinds(word, files, path).items():
        folder = _folder(url) if _name(url) == METADATA else url
        if kind == "file" and folder == url:
            found.append(url)
        else:
            beside = _below(files, folder)
            found += [each for each in beside if _folder(each) == folder and is_recording_name(_name(each))]
    if not found:
        raise BagError(f"{redacted(word)}: holds no recording: name a file, or a folder that has one in it")
    return sorted(found, key=natural)


def metadata_of(word: str) -> str | None:
    """Return the URL of the metadata.yaml in the folder that a word means; None if there is none."""
    if not _is_listed(word) or _PATTERN.search(word):
        return None
    files, path = file_system(word)
    folder = files.unstrip_protocol(path.rstrip("/").removesuffix(f"/{METADATA}"))
    url = f"{folder}/{METADATA}"
    return url if url in _below(files, folder) else None


def _is_listed(word: str) -> bool:
    return is_url(word) and scheme_of(word) not in SERVERS


def _kinds(word: str, files: Any, path: str) -> dict[str, str]:
    """Return the URLs that a word means, each with its type: `file` or `directory`."""
    if not _PATTERN.search(word):
        return {files.unstrip_protocol(path.rstrip("/")): tried(word, lambda: str(files.info(path)["type"]))}
    found = tried(word, lambda: files.glob(path, detail=True))
    return {files.unstrip_protocol(each): str(about["type"]) for each, about in found.items()}


def _below(files: Any, folder: str) -> list[str]:
    """Return the URLs of all files below a folder, at any depth."""
    return [files.unstrip_protocol(path) for path in tried(folder, lambda: files.find(folder))]


def _name(url: str) -> str:
    return url.rpartition("/")[2]


def _folder(url: str) -> str:
    return url.rpartition("/")[0]
