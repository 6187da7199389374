"""Updates a test file to expect what was found; comments stay."""

import json
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

from ruamel.yaml.error import YAMLError
from ruamel.yaml.scalarstring import LiteralScalarString

from syncrelay.config import ConfigError
from syncrelay.config.document import Document, MappingNode, plain
from syncrelay.config.problems import Path
from syncrelay.config.source import Source, check_text
from syncrelay.config.yaml_tree import compose
from syncrelay.errors import SyncRelayError
from syncrelay.recordings.analysis.changes import edited
from syncrelay.recordings.cases.checking import Mismatch, Renewal
from syncrelay.recordings.cases.drawing import with_expected


def updated(
    document: Document, source: Source, mismatches: Sequence[Mismatch], *, environ: Mapping[str, str] = os.environ
) -> str:
    """Return the text of a test file, updated to expect what was found wherever a file can.

    Raises SyncRelayError if the update would change the meaning of anything else in the file.
    """
    renewed = [(each.path, each.renewed) for each in mismatches if each.renewed is not None]
    wanted = plain(document.root)
    for path, value in renewed:
        wanted = _with(wanted, path, value)
    # The editor writes some keys, such as `~`, differently from how they were read.
    with suppress(YAMLError, ConfigError, KeyError):
        text = _edited(document, source.text, renewed)
        read, _ = compose(check_text(text, name=source.name), environ, expected="")
        if _comparable(plain(read.root), renewed) == _comparable(wanted, renewed):
            return text
    raise SyncRelayError(
        f"{source.name}: cannot be updated without changing more than was found: where cases share values by"
        " anchors or merge keys, write the new ones by hand"
    )


def _comparable(tree: Any, renewed: Sequence[tuple[Path, Renewal]]) -> str:
    """Return the content of a file, with the new values as texts: `0.98` may be read as a number."""
    for path, _ in renewed:
        value = tree
        for step in path:
            value = value[step]
        if not isinstance(value, tuple | list):
            tree = _with(tree, path, str(value))
    return json.dumps(tree, sort_keys=True)


def _with(tree: Any, path: Path, value: Renewal) -> Any:
    """Return a copy of a tree with another value at a path of mappings."""
    if path:
        step, *below = path
        return {**tree, step: _with(tree[step], tuple(below), value)}
    return with_expected(tree, value) if isinstance(value, tuple) else value


def _edited(document: Document, text: str, renewed: Sequence[tuple[Path, Renewal]]) -> str:
    def edit(whole: Any) -> None:
        # Find all places before setting any: setting a merged key makes it the mapping's own.
        places = [_place(document, whole, path) for path, _ in renewed]
        for (mapping, key), (_, value) in zip(places, renewed, strict=True):
            mapping[key] = _renewed(mapping[key], value)

    return edited(text, edit)


def _place(document: Document, whole: Any, path: Path) -> tuple[Any, Any]:
    """Return the mapping and the key at a path, found by their order because the editor reads the key `1` as a number.

    In both trees merged keys come after a mapping's own.
    """
    mapping: Any = whole
    for depth, step in enumerate(path):
        node = document.node(path[:depth])
        assert isinstance(node, MappingNode)  # noqa: S101  expectations stand in mappings
        own = [key for key, _ in mapping.non_merged_items()]
        at = list(node.entries).index(str(step))
        key = own[at] if at < len(own) else str(step)
        if depth + 1 < len(path):
            mapping = mapping[key]
    return mapping, key


def _renewed(before: Any, renewed: Renewal) -> Any:
    """Return the new value in the style of the old one: quotes, blocks and brackets stay."""
    match renewed:
        case tuple():
            return LiteralScalarString(with_expected(before, renewed))
        case list():
            before[:] = renewed
            return before
        case str() if isinstance(before, str):
            return type(before)(renewed)
        case _:
            return renewed
