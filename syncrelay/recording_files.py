"""What the files, folders and URLs of recordings are called. Imports nothing slow."""

import re
from pathlib import Path, PurePosixPath
from typing import Final

SUFFIXES: Final = (".mcap", ".db3", ".bag", ".active")
"""What the files of recordings end in, but for how they are compressed."""

METADATA: Final = "metadata.yaml"
"""What stands beside the files of rosbag2, in a folder that is one recording."""

COMPRESSED: Final = (".bz2", ".zstd", ".zst", ".gz")
"""What the name of a file that is compressed as a whole ends in."""


# With the protocols that fsspec chains before it, as in `simplecache::s3://`.
_SCHEME: Final = re.compile(r"((?:[a-z][a-z0-9+.-]*::)*[a-z][a-z0-9+.-]*)://", re.IGNORECASE)


def scheme_of(word: str) -> str:
    """Return the scheme of a URL in lower case; nothing of what is none."""
    found = _SCHEME.match(word)
    return found.group(1).lower() if found else ""


def is_recording_name(name: str) -> bool:
    """Tell whether a file has the name of a recording, compressed or not."""
    path = PurePosixPath(name)
    return (PurePosixPath(path.stem).suffix if path.suffix in COMPRESSED else path.suffix) in SUFFIXES


def holds_recording(path: str) -> bool:
    """Tell whether there is a file with the name of a recording, or a folder with files of one and no other YAML."""
    try:
        if not Path(path).is_dir():
            return is_recording_name(path) and Path(path).exists()
        names = [each.name for each in Path(path).iterdir()]
    except (OSError, ValueError):
        return False
    has_other = any(name.endswith((".yaml", ".yml")) and name != METADATA for name in names)
    return any(map(is_recording_name, names)) and not has_other
