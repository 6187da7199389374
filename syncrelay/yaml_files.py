"""YAML files before they are read: which of a directory are meant, and the groups of one. Imports nothing slow."""

from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Any, Final

MOST_FILES: Final = 1000
"""In a directory that is named as one configuration."""

_ENDINGS: Final = (".yaml", ".yml")


def yaml_files(path: str) -> tuple[str, ...]:
    """Return the YAML files of a directory in the order of their names.

    What is no directory stands for itself, and so does one of which no files are read, see files_of.
    """
    try:
        files = files_of(path) if path and Path(path).is_dir() else ()
    except OSError:
        return (path,)
    return files if 0 < len(files) <= MOST_FILES else (path,)


def files_of(folder: str) -> tuple[str, ...]:
    """Return the YAML files of a directory in the order of their names, one more than MOST_FILES at most.

    Those below it and hidden files, which editors and mounts leave there, are not meant. Raises OSError for a directory
    that cannot be read.
    """
    found = (each for each in Path(folder).iterdir() if each.suffix in _ENDINGS and not each.name.startswith("."))
    return tuple(map(str, sorted(islice((each for each in found if not each.is_dir()), MOST_FILES + 1))))


def group_names(text: bytes) -> list[str]:
    """Return the keys below `groups` of a YAML text; none of one that is not valid."""
    import yaml  # noqa: PLC0415  completion asks for it at few presses of TAB

    with suppress(yaml.YAMLError):
        root = yaml.compose(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
        groups = [group for key, value in _entries(root) if key == "groups" for group, _ in _entries(value)]
        return [group for group in groups if group != "<<"]
    return []


def _entries(node: Any) -> list[tuple[str, Any]]:
    """Return the keys and values of a node of PyYAML's; none where it is no mapping."""
    pairs = node.value if getattr(node, "id", "") == "mapping" else ()
    return [(key.value, value) for key, value in pairs if key.id == "scalar"]
