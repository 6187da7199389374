"""A directory where a file could be named: which of its files are meant, and in which order. Imports nothing slow."""

from itertools import islice
from pathlib import Path
from typing import Final

MOST_FILES: Final = 1000
"""In a directory that is named as one configuration."""

_ENDINGS: Final = (".yaml", ".yml")


def yaml_files(path: str) -> tuple[str, ...]:
    """Return the YAML files of a directory in the order of their names, one more than MOST_FILES at most.

    What is no directory stands for itself. Those below it and hidden files, which editors and mounts leave there, are
    not meant. Raises OSError for a directory that cannot be read.
    """
    if not path or not Path(path).is_dir():
        return (path,)
    found = (each for each in Path(path).iterdir() if each.suffix in _ENDINGS and not each.name.startswith("."))
    return tuple(map(str, sorted(islice((each for each in found if not each.is_dir()), MOST_FILES + 1))))
