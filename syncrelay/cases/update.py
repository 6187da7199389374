"""A test file's text with what is in place of what was expected; comments stay."""

from collections.abc import Sequence
from typing import Any

from ruamel.yaml.scalarstring import LiteralScalarString

from syncrelay.bag.analysis.changes import dumped, editor
from syncrelay.cases.checking import Mismatch, Renewal
from syncrelay.cases.drawing import with_expected


def updated(text: str, mismatches: Sequence[Mismatch]) -> str:
    """Return the text of a test file that expects what was found, wherever a file can."""
    yaml = editor()
    document = yaml.load(text)
    for mismatch in mismatches:
        if mismatch.renewed is not None:
            *parents, key = mismatch.path
            mapping: Any = document
            for step in parents:
                mapping = mapping[step]
            mapping[key] = _renewed(mapping[key], mismatch.renewed)
    return dumped(yaml, document)


def _renewed(before: Any, renewed: Renewal) -> Any:
    """Return the new value, written as the one before: quotes, blocks and brackets stay."""
    match renewed:
        case tuple():
            text = with_expected(before, renewed)
            return LiteralScalarString(text)
        case list():
            before[:] = renewed
            return before
        case str() if isinstance(before, str):
            return type(before)(renewed)
        case _:
            return renewed
