"""The library as its page shows it: the public names of the engine, from their docstrings and signatures."""

import inspect
from collections.abc import Iterator
from typing import Final, NamedTuple, get_args

import syncrelay.sync
from docs.generate.markdown import linked, plain
from syncrelay.sync import Outcome, Restamp, StampQueue, SyncGroup

# What is public of classes that are more than values.
_METHODS: Final = {
    SyncGroup: ("add", "expire", "next_deadline", "flush", "reject", "counts", "sets", "lapses"),
    StampQueue: ("insert", "take"),
}


class _Name(NamedTuple):
    call: str
    meaning: str


def names() -> Iterator[_Name]:
    """Yield each public name as it is called, and what it is; the group first."""
    for name in dict.fromkeys((SyncGroup.__name__, *syncrelay.sync.__all__)):
        found = getattr(syncrelay.sync, name)
        if found is Outcome:
            yield _Name(f"`{name}`", " or ".join(f"`{each.__name__}`" for each in map(_origin, get_args(found))))
            continue
        yield _Name(f"`{name}{_arguments(found)}`", _meaning(found))
        for method in _METHODS.get(found, ()):
            value = vars(found)[method]
            call = "" if isinstance(value, property) else _arguments(value)
            yield _Name(f"`{name}.{method}{call}`", _first(inspect.getdoc(value) or ""))


def _origin(annotation: object) -> type:
    origin = getattr(annotation, "__origin__", annotation)
    assert isinstance(origin, type)  # noqa: S101  an outcome is one of two classes
    return origin


def _arguments(called: object) -> str:
    """Return the arguments without their types; none of a closed set or a protocol, which nobody calls."""
    if getattr(called, "_is_protocol", False) or hasattr(called, "__members__"):
        return ""
    assert callable(called)  # noqa: S101  all others are classes and methods
    signature = inspect.signature(called)
    bare = [
        each.replace(annotation=inspect.Parameter.empty) for key, each in signature.parameters.items() if key != "self"
    ]
    return str(inspect.Signature(bare))


def _meaning(found: type) -> str:
    """Return what a docstring says of values and arguments; of what is drawn in it, the first sentence."""
    said = inspect.getdoc(found) or ""
    meaning = said.replace("\n\n", " ") if "\n    " not in said and "\n- " not in said else _first(said)
    of_arguments = inspect.cleandoc(vars(found)["__init__"].__doc__ or "") if found in _METHODS else ""
    members = f"`{'`, `'.join(each.name for each in Restamp)}`." if found is Restamp else ""
    return linked(plain(" ".join(f"{meaning} {of_arguments.partition(chr(10) * 2)[2]} {members}".split())))


def _first(said: str) -> str:
    return plain(" ".join(said.partition("\n\n")[0].split()))
