"""The document that /status gives as its page shows it: each object of it with its fields."""

import ast
import inspect
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum

from syncrelay.status import document

_WORDS = {
    "Text": "string",
    "str": "string",
    "int": "integer",
    "Number": "number",
    "Rate": "number",
    "bool": "boolean",
    "Mapping[Text, int]": "counts by name",
    "Recent": "`set` or `drop`",
}


@dataclass(frozen=True, slots=True)
class _Field:
    name: str
    type: str
    meaning: str


@dataclass(frozen=True, slots=True)
class _Object:
    name: str
    meaning: str
    fields: Sequence[_Field]


def objects() -> Sequence[_Object]:
    """Return the objects of the document, the whole one first."""
    nodes = ast.parse(inspect.getsource(document)).body
    classes = [node for node in nodes if isinstance(node, ast.ClassDef) and node.decorator_list]
    return [_Object(node.name, ast.get_docstring(node) or "", tuple(_fields(node))) for node in reversed(classes)]


def _fields(node: ast.ClassDef) -> Iterator[_Field]:
    """Yield each field with the docstring that follows it."""
    for field, below in zip(node.body, node.body[1:], strict=False):
        match field, below:
            case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(meaning))):
                yield _Field(name, _type(ast.unparse(field.annotation)), meaning)
            case ast.AnnAssign(), _:
                raise ValueError(f"{node.name}: `{ast.unparse(field)}` lacks a docstring below it")


def _type(annotation: str) -> str:
    """Say what a value is in JSON's words."""
    if annotation.endswith(" | None"):
        return f"{_type(annotation.removesuffix(' | None'))} or null"
    if annotation.startswith("tuple["):
        return f"list of {_type(annotation.removeprefix('tuple[').removesuffix(', ...]'))}"
    if annotation in _WORDS:
        return _WORDS[annotation]
    named = getattr(document, annotation)
    if issubclass(named, Enum):
        return ", ".join(f"`{each.value}`" for each in named)
    return f"[{annotation}](#{annotation.lower()})"
