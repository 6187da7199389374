"""What rosbag2's metadata.yaml lists, compared with the files that are there."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath, PurePosixPath
from typing import Any, Final

from syncrelay.config.wording import all_of, counted
from syncrelay.errors import BagError
from syncrelay.printable import printable
from syncrelay.recording_files import COMPRESSED, METADATA
from syncrelay.recordings.bag.qos import plain_yaml
from syncrelay.recordings.bag.recording import topic_name

LARGEST: Final = 4_000_000
"""The largest metadata.yaml that is read, in bytes: enough for some 10,000 files."""

# The durations in the QoS profiles of a topic.
_DEEPEST: Final = 8
_ROOT: Final = "rosbag2_bagfile_information"
_NAMED: Final = 5


@dataclass(frozen=True, slots=True)
class Metadata:
    """Number of messages in each file (None if not listed) and of each topic."""

    files: Mapping[str, int | None]
    topics: Mapping[str, int]

    def missing(self, there: Sequence[str]) -> str:
        """Return a sentence on files that are missing among those `there`; an empty text if none is.

        A file may have been compressed or decompressed since. If as many other files are there, files were renamed, and
        only counting messages can show whether one is missing.
        """
        plain = {_unpacked(name) for name in there}
        gone = [name for name in self.files if _unpacked(name) not in plain]
        if len(there) - (len(self.files) - len(gone)) >= len(gone):
            return ""
        counts = [count for name in gone if (count := self.files[name]) is not None]
        held = f", with {counted(sum(counts), 'message')}" if len(counts) == len(gone) else ""
        names = [printable(name) for name in gone[:_NAMED]]
        if len(gone) > _NAMED:
            names.append(f"{len(gone) - _NAMED} more")
        are = "is" if len(gone) == 1 else "are"
        of_files = f"{len(gone)} of the {len(self.files)} files that {METADATA} names"
        return f"{of_files} {are} missing{held}: {all_of(names)}"


def parse_metadata(content: bytes) -> Metadata | None:
    """Return the content of a metadata.yaml; None if it is not rosbag2's.

    Raises BagError, without the file's name, if it cannot be read.
    """
    if len(content) > LARGEST:
        raise BagError(f"is larger than {LARGEST // 1_000_000} MB")
    document = plain_yaml(content.decode(errors="replace"), longest=LARGEST, deepest=_DEEPEST)
    if document is None:
        raise BagError("is damaged")
    about = document.get(_ROOT) if isinstance(document, dict) else None
    if not isinstance(about, dict):
        return None
    # Older versions name files with their folder, and do not count the messages of each.
    files: dict[str, int | None] = {
        PurePosixPath(each).name: None for each in _listed(about, "relative_file_paths") if isinstance(each, str)
    }
    for each in _dicts(about, "files"):
        if isinstance(path := each.get("path"), str) and PurePosixPath(path).name in files:
            files[PurePosixPath(path).name] = _count(each)
    topics: dict[str, int] = {}
    for each in _dicts(about, "topics_with_message_count"):
        topic = each.get("topic_metadata")
        name = topic.get("name") if isinstance(topic, dict) else None
        if isinstance(name, str):
            topics[printable(topic_name(name))] = _count(each) or 0
    return Metadata(files, topics)


def _listed(about: Mapping[str, Any], key: str) -> Sequence[Any]:
    found = about.get(key)
    return found if isinstance(found, list) else ()


def _dicts(about: Mapping[str, Any], key: str) -> Iterator[Mapping[str, Any]]:
    return (each for each in _listed(about, key) if isinstance(each, dict))


def _count(about: Mapping[str, Any]) -> int | None:
    count = about.get("message_count")
    return count if type(count) is int and count >= 0 else None


def _unpacked(name: str) -> str:
    path = PurePath(name)
    return path.stem if path.suffix in COMPRESSED else name
