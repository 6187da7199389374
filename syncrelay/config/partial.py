"""The valid keys of a file with faults, so that checks between keys run on what is left."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

from pydantic_core import ErrorDetails

from syncrelay.config.document import Document, MappingNode, Node, ScalarNode, SequenceNode
from syncrelay.config.file import FileKeys, file_format, partial_format
from syncrelay.config.places import place
from syncrelay.config.problems import Path


def partial_file(document: Document, errors: Sequence[ErrorDetails]) -> tuple[Document, FileKeys]:
    """Return the tree of a file that pydantic refused with its faulty keys marked, and the keys without them.

    A required key that is missing is None, a topic's name empty; of features there are none then.
    """
    # If only a group's name is refused, its keys are valid.
    locs = (error["loc"] for error in errors if error["loc"][2:] != ("[key]",))
    faulty = frozenset(_key(place(file_format().file, loc).path) for loc in locs)
    usable = _usable(document.root, (), faulty)
    keys = usable if isinstance(usable, dict) else {}
    return replace(document, faulty=faulty), partial_format().model_validate(keys)


def _key(path: Path) -> Path:
    """Return the key of the file, a group, a topic or `export` above a path: it is faulty as a whole."""
    match path:
        case ("groups", _, "topics", *_):
            return path[:5]
        case ("groups", *_):
            return path[:3]
        case ("export", "lerobot", "features", *_):
            return path[:4]
        case ("export", "lerobot", *_):
            return path[:3]
        case _:
            return path[:2]


def _usable(node: Node, path: Path, faulty: Collection[Path]) -> Any:
    """Return the tree as dicts, tuples and scalars; an item that is faulty as a whole is an empty mapping."""
    match node:
        case ScalarNode():
            return node.value
        case SequenceNode():
            items = enumerate(node.items)
            return tuple({} if (*path, i) in faulty else _usable(item, (*path, i), faulty) for i, item in items)
        case MappingNode():
            entries = ((key, (*path, key), entry.value) for key, entry in node.entries.items())
            return {key: _usable(value, below, faulty) for key, below, value in entries if below not in faulty}
