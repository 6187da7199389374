"""YAML files before they are read: which of a directory are meant, and the groups of one. Imports nothing slow."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
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


def group_names(text: bytes) -> Iterator[str]:
    """Give the keys below `groups` of a YAML text, up to its first fault."""
    import yaml  # noqa: PLC0415  completion asks for it at few presses of TAB

    # The open mappings and lists, each with the last of its scalars, and whether a mapping expects a key next.
    opened: list[_Opened] = []
    with suppress(yaml.YAMLError):
        for event in yaml.parse(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader)):
            if isinstance(event, yaml.NodeEvent) and opened:
                key = opened[-1].take(event.value if isinstance(event, yaml.ScalarEvent) else "")
                if key not in ("", "<<") and [each.key for each in opened[:-1]] == ["groups"]:
                    yield key
            if isinstance(event, yaml.CollectionStartEvent):
                opened.append(_Opened(isinstance(event, yaml.MappingStartEvent)))
            elif isinstance(event, yaml.CollectionEndEvent):
                opened.pop()


@dataclass(slots=True)
class _Opened:
    """A mapping or a list whose end has not come: its last key, and whether a key is next."""

    is_mapping: bool
    key: str = ""
    expects_key: bool = True

    def take(self, text: str) -> str:
        """Take what comes next in it; return it if it is a key."""
        is_key = self.is_mapping and self.expects_key
        self.expects_key = not self.expects_key
        if is_key:
            self.key = text
        return text if is_key else ""
