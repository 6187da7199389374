"""A test file's text with what is in place of what was expected; comments stay."""

from collections.abc import Sequence
from typing import Any

from ruamel.yaml.scalarstring import LiteralScalarString

from syncrelay.bag.analysis.changes import dumped, editor
from syncrelay.cases.checking import Mismatch, Renewal
from syncrelay.cases.drawing import with_expected
from syncrelay.config.document import Document, MappingNode
from syncrelay.config.problems import Path


def updated(document: Document, text: str, mismatches: Sequence[Mismatch]) -> str:
    """Return the text of a test file, read as this document, that expects what was found, wherever a file can."""
    yaml = editor()
    whole = yaml.load(text)
    for mismatch in mismatches:
        if mismatch.renewed is not None:
            mapping, key = _place(document, whole, mismatch.path)
            mapping[key] = _renewed(mapping[key], mismatch.renewed)
    return dumped(yaml, whole)


def _place(document: Document, whole: Any, path: Path) -> tuple[Any, Any]:
    """Return the mapping and the key at a path, by their order: to the editor the key `1` is a number."""
    mapping: Any = whole
    for depth, step in enumerate(path):
        node = document.node(path[:depth])
        assert isinstance(node, MappingNode)  # noqa: S101  expectations stand in mappings
        key = list(mapping)[list(node.entries).index(str(step))]
        if depth + 1 < len(path):
            mapping = mapping[key]
    return mapping, key


def _renewed(before: Any, renewed: Renewal) -> Any:
    """Return the new value, written as the one before: quotes, blocks and brackets stay."""
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
