"""The keys of a file as their page shows them."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import yaml

from docs.generate.markdown import linked
from syncrelay.config.file import file_format
from syncrelay.config.models import Group, Topic
from syncrelay.config.schema import REF, Schema, json_schema

_SCHEMA = json_schema()
# Editors show these with each key; the page says them once.
_UNITS = (
    " A number is seconds, a string has a unit (ns, us, ms, s, min).",
    " A number is Hz, a string has a unit (Hz, kHz).",
)


@dataclass(frozen=True, slots=True)
class _Key:
    """A key, what it means, and a line of what it takes; None where its meaning says that."""

    name: str
    meaning: str
    takes: str | None


@dataclass(frozen=True, slots=True)
class _Policy:
    name: str
    meaning: str
    keys: Sequence[_Key]
    keys_of_topics: Sequence[_Key]


def of_file() -> Iterator[_Key]:
    """Yield the keys of the whole file."""
    yield from (_key(name, _SCHEMA) for name in _SCHEMA["properties"])


def of_model(model: str) -> Iterator[_Key]:
    """Yield the keys of a model, by its name in the schema."""
    schema = _SCHEMA["definitions"][model]
    yield from (_key(name, schema) for name in schema["properties"])


def of_group() -> Iterator[_Key]:
    """Yield the keys that the groups of every policy have."""
    return (key for key in of_model(file_format().any_group.__name__) if key.name in Group.model_fields)


def of_topic() -> Iterator[_Key]:
    """Yield the keys that the topics of every policy have."""
    return (key for key in of_model(file_format().any_topic.__name__) if key.name in Topic.model_fields)


def policies() -> Iterator[_Policy]:
    """Yield what each policy has beside the keys of every group and topic."""
    form = file_format()
    shown: dict[_Key, str] = {}
    for name, model in form.groups.items():
        schema, topic = (_SCHEMA["definitions"][each.__name__] for each in (model, form.topics[name]))
        own = [key for key in model.model_fields if key not in Group.model_fields]
        of_topics = [key for key in form.topics[name].model_fields if key not in Topic.model_fields]
        yield _Policy(
            name,
            schema["properties"]["policy"]["description"],
            tuple(_once(_key(key, schema), shown, name) for key in own),
            tuple(_key(key, topic) for key in of_topics),
        )


def _once(key: _Key, shown: dict[_Key, str], policy: str) -> _Key:
    """Return a key, or where to find it if another policy has the same."""
    first = shown.setdefault(key, policy)
    return key if first == policy else _Key(key.name, f"As for [`{first}`](#{first}).", None)


def _key(name: str, model: Schema) -> _Key:
    schema = model["properties"][name]
    meaning = schema.get("description", "")
    for units in _UNITS:
        meaning = meaning.replace(units, "")
    return _Key(name, linked(meaning), " ".join(_takes(name, schema)) or None)


def _takes(name: str, schema: Schema) -> Iterator[str]:
    kinds = schema.get("anyOf") or schema.get("allOf") or [schema]
    words = [word for kind in kinds for word in kind.get("enum", ())]
    if len(words) > 1:
        mapping = (
            " or a mapping" if any(kind.get("$ref", "").startswith(REF) and _is_mapping(kind) for kind in kinds) else ""
        )
        yield f"One of {', '.join(f'`{word}`' for word in words)}{mapping}."
    for kind in kinds:
        if kind.get("type") == "integer" and "const" not in kind:
            least, most = (kind.get(limit) for limit in ("minimum", "maximum"))
            yield f"A whole number{f' from {least:,} to {most:,}' if most is not None else ''}."
    examples = [each for each in schema.get("examples", ()) if each not in words]
    if examples:
        shown = ", ".join(f"`{name}: {_written(each)}`" for each in examples)
        yield f"Example{'s' if len(examples) > 1 else ''}: {shown}."


def _is_mapping(kind: Schema) -> bool:
    return bool(_SCHEMA["definitions"][kind["$ref"].removeprefix(REF)].get("type") == "object")


def _written(value: Any) -> str:
    """Return a value as a file has it, in one line."""
    if isinstance(value, str):
        return value
    if isinstance(value, dict | list):
        return yaml.safe_dump(value, default_flow_style=True, width=1000).strip()
    return json.dumps(value)
