"""Places in a file as pydantic names them: the path in the file, and the model whose keys stand there.

pydantic's places have the tags of unions in them, here in <>. The models tell a tag from a key that looks like one.
"""

from collections.abc import Iterator
from types import UnionType
from typing import Annotated, Any, NamedTuple, TypeAlias, Union, get_args, get_origin

from pydantic import BaseModel, Tag

from syncrelay.config.problems import Path

Location: TypeAlias = tuple[str | int, ...]
"""A place in pydantic's words: a path with the tags of unions in it."""


class Place(NamedTuple):
    """A path in the file, the model whose keys stand there, and the tags on the way, None where there is none."""

    path: Path
    model: type[BaseModel]
    tag: str | None


def place(file: type[BaseModel], loc: Location) -> Place:
    """Return where a place of pydantic's is in a file of this model; `tag` is the last on the way."""
    kind: Any = file
    above: Any = None
    path: Path = ()
    last: str | None = None
    for index, step in enumerate(loc):
        tagged = dict(_tagged(kind))
        if step in tagged:
            kind, last = tagged[step], str(step).strip("<>")
        elif step != "[key]" or index < len(loc) - 1 or get_origin(above) is not dict:
            above, kind, path = kind, _below(kind, step), (*path, step)
    return Place(path, next(_models(kind), file), last)


def _tagged(kind: Any) -> Iterator[tuple[str | int, Any]]:
    """Yield the branches of a union by their tags; of one whose branches have none, the mapping among them."""
    if get_origin(kind) is Annotated:
        yield from _tagged(get_args(kind)[0])
    elif get_origin(kind) in (Union, UnionType):
        for branch in get_args(kind):
            tags = [each.tag for each in get_args(branch)[1:] if isinstance(each, Tag)]
            if tags:
                yield tags[0], branch
            elif len([each for each in get_args(kind) if each is not type(None)]) > 1:
                yield ("<mapping>" if _is_model(branch) else "<name>"), branch


def _below(kind: Any, step: str | int) -> Any:
    if _is_model(kind):
        field = kind.model_fields.get(step)
        return None if field is None else field.annotation
    if get_origin(kind) is dict:
        return get_args(kind)[1]
    if get_origin(kind) is tuple:
        return get_args(kind)[0]
    if get_origin(kind) is Annotated:
        return _below(get_args(kind)[0], step)
    if get_origin(kind) in (Union, UnionType):
        return next((found for branch in get_args(kind) if (found := _below(branch, step)) is not None), None)
    return None


def _models(kind: Any) -> Iterator[type[BaseModel]]:
    if _is_model(kind):
        yield kind
    elif get_origin(kind) in (Annotated, Union, UnionType):
        for branch in get_args(kind):
            yield from _models(branch)


def _is_model(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, BaseModel)
