"""pydantic's errors as problems: at the right key or value, in plain words, with the nearest valid word."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from pydantic import BaseModel
from pydantic_core import ErrorDetails

from syncrelay.config.document import Document, MappingNode, ScalarNode
from syncrelay.config.places import Location, place
from syncrelay.config.problems import Path, Problem
from syncrelay.config.scalars import read_plain
from syncrelay.config.wording import all_of, describe, one_of, or_nearest, quoted

_EXPECTED: Final = {
    "int_type": "a whole number",
    "float_type": "a number",
    "bool_type": "true or false",
    "string_type": "a string",
    "tuple_type": "a list",
    "dict_type": "a mapping",
    "model_type": "a mapping",
    "model_attributes_type": "a mapping",
    "finite_number": "a finite number",
}
# The mappings that these keys take in place of a word.
_MAPPING_FORMS: Final = {"qos": "a mapping", "stamp": "{field: path.to.a.Time}"}
# `topic` and `topics` are this alike: then suggest the key of this place, although another place has the word.
_A_SLIP: Final = 0.8
# Booleans in YAML 1.1 and other formats.
_TRUTH_WORDS: Final = ("yes", "no", "on", "off", "true", "false")
# Needs no quotes in a suggestion such as `[word]`.
_A_WORD: Final = re.compile(r"[\w./~-]{1,80}")


@dataclass(frozen=True, slots=True)
class Form:
    """What the words of an error come from, for one kind of file: its model, and where in it keys can stand, in words.

    `missing` says what is expected in place of some keys; of others, the examples of the models do. `kinds` are models
    of one level that differ by what people call them, which is the tag of a union.
    """

    file: type[BaseModel]
    levels: Mapping[str, type[BaseModel]]
    missing: Mapping[str, str]
    kinds: Sequence[Mapping[str, type[BaseModel]]] = ()

    def path(self, loc: Location) -> Path:
        """Return the path of a place of pydantic's."""
        return place(self.file, loc).path

    def model(self, loc: Location) -> type[BaseModel]:
        """Return the model whose keys stand at a place of pydantic's."""
        return place(self.file, loc).model

    def owners(self, loc: Location) -> str | None:
        """Return which kinds alone have a key that is missing in the kind at this place; None for other keys."""
        key, (_, model, kind) = str(loc[-1]), place(self.file, loc[:-1])
        others = next((models for models in self.kinds if models.get(kind or "") is model), {})
        owners = [other for other, its_model in others.items() if key in its_model.model_fields]
        verb = "does" if len(owners) == 1 else "do"
        return f"{kind} has no `{key}`, only {all_of(owners)} {verb}" if owners else None

    def expected(self, loc: Location) -> str:
        """Say what is expected where a key is missing."""
        key = str(loc[-1])
        if key in self.missing:
            return self.missing[key]
        kind = str(loc[-2]).strip("<>") if len(loc) > 1 else ""
        is_known = any(kind in models for models in self.kinds)
        example = (self.model(loc[:-1]).model_fields[key].examples or [""])[0]
        return f"{f'{kind} needs it, ' if is_known else ''}for example `{key}: {example}`"


def translate(errors: Sequence[ErrorDetails], document: Document, form: Form) -> list[Problem]:
    """Return a problem for every error that is not a consequence of another one."""
    # In the order of the file, as suggestions are limited in number.
    located = sorted(
        ((form.path(error["loc"]), error) for error in errors), key=lambda each: document.key_span(each[0])[:2]
    )
    meant = {
        path: document.nearest(str(path[-1]), form.model(error["loc"][:-1]).model_fields)
        for path, error in located
        if error["type"] == "extra_forbidden"
    }
    misspelt = {(*path[:-1], key) for path, key in meant.items()}
    problems = []
    for path, error in located:
        if error["type"] == "missing" and path in misspelt:
            continue
        node = document.node(path)
        if isinstance(node, ScalarNode) and not node.readable:
            continue
        problems.append(_problem(error, path, meant.get(path), document, form))
    return problems


def _problem(error: ErrorDetails, path: Path, meant: str | None, document: Document, form: Form) -> Problem:
    match error["type"]:
        case "extra_forbidden":
            text = _unknown_key(error["loc"], meant, document, form)
            return document.problem(path, text, code="unknown_key", span=document.key_span(path))
        case "missing":
            text = f"missing, {form.expected(error['loc'])}"
            return document.problem(path, text, code="missing_key", span=_owner_span(path, document))
        case kind if kind in _EXPECTED:
            found = document.filled_in(path)
            said = f"{_found(error['input'], kind)}{_rather(error, form)}" if found is None else f"found {found}"
            text = f"expected {_EXPECTED[kind]}, {said}"
            return document.problem(path, text, code="wrong_type", span=document.value_span(path))
        case kind:
            at_key = error["loc"][-1] == "[key]"
            span = document.key_span(path) if at_key else document.value_span(path)
            return document.problem(path, _bad_value(error, path, document, form), code="bad_value", span=span)


def _bad_value(error: ErrorDetails, path: Path, document: Document, form: Form) -> str:
    filled_in = document.filled_in(path)
    found = error["input"] if filled_in is None else filled_in
    context: dict[str, Any] = error.get("ctx", {})
    match error["type"]:
        case "value_error" if filled_in is not None:
            # The error may quote part of the value, which may be secret.
            return f"expected {_example(error['loc'], form)}, found {filled_in}"
        case "value_error":
            return str(context["error"])
        case "greater_than_equal" | "greater_than":
            least = f"{context['ge']:g} or more" if "ge" in context else f"more than {context['gt']:g}"
            return f"expected {least}, found {describe(found)}"
        case "less_than_equal":
            return f"expected {context['le']} or less, found {describe(found)}"
        case "literal_error":
            words = [word.strip("'") for word in context["expected"].replace(" or ", ", ").split(", ")]
            return _no_such_word(found, words, error["loc"], document)
        case _:
            return f"{error['msg'][0].lower()}{error['msg'][1:]}, found {describe(found)}"


def _example(loc: Location, form: Form) -> str:
    """Return what a key takes: one of its examples, or the words of its model."""
    while loc and (isinstance(loc[-1], int) or loc[-1].startswith("<")):
        loc = loc[:-1]
    field = form.model(loc[:-1]).model_fields.get(str(loc[-1])) if loc else None
    example = ((field.examples if field is not None else None) or [None])[0]
    example = example[0] if isinstance(example, list) else example
    return f"a value such as `{example}`" if isinstance(example, str | int | float) else "another value"


def _no_such_word(found: object, words: Sequence[str], loc: Location, document: Document) -> str:
    close = document.nearest(found, words) if isinstance(found, str) else None
    if close is not None:
        return f"unknown value {quoted(str(found))}{or_nearest(close)}"
    choices = [*words, _MAPPING_FORMS[str(loc[-2])]] if loc[-1] == "<name>" else words
    is_a_name = loc[-1] == "policy" and isinstance(found, str)
    elsewhere = " (a policy of another package needs that package installed)" if is_a_name else ""
    return f"expected {one_of(choices)}, found {describe(found)}{elsewhere}"


def _rather(error: ErrorDetails, form: Form) -> str:
    """Suggest what to write if the value shows what was meant; else return nothing."""
    found, loc = error["input"], error["loc"]
    match error["type"]:
        case "tuple_type" if _is_word(found) and loc[-1] != "topics":
            return f": write `[{found}]`"
        case "model_type" | "model_attributes_type" if _is_word(found) and loc[-2:-1] == ("topics",):
            return f": write `topic: {found}`"
        case "model_type" | "model_attributes_type" if isinstance(found, bool) and len(loc) == 1:
            return f": write its keys, such as `{next(iter(form.model(loc).model_fields))}`, or leave it out"
        case "string_type" if isinstance(found, int | float):
            field = form.model(loc[:-1]).model_fields.get(str(loc[-1]))
            return f": write for example `{field.examples[0]}`" if field is not None and field.examples else ""
        case _:
            return ""


def _is_word(value: object) -> bool:
    return isinstance(value, str) and _A_WORD.fullmatch(value) is not None


def _found(value: object, kind: str) -> str:
    found = f"found {describe(value)}"
    if not isinstance(value, str):
        return found
    if kind == "bool_type" and value.lower() in _TRUTH_WORDS:
        return f"{found}, which YAML 1.2 reads as a string"
    if kind in ("int_type", "float_type") and isinstance(read_plain(value), int | float):
        return f"{found}: write it without quotes"
    return found


def _unknown_key(loc: Location, meant: str | None, document: Document, form: Form) -> str:
    key, model = str(loc[-1]), form.model(loc[:-1])
    owners = form.owners(loc)
    if owners is not None:
        return owners
    levels = [level for level, owner in form.levels.items() if key in owner.model_fields]
    if levels and document.nearest(key, model.model_fields, likeness=_A_SLIP) is None:
        return f"`{key}` does not belong here, it is a key of {levels[0]}"
    if "$" in key:
        return "unknown key; variables work in values only"
    if ":" in key:
        return "unknown key: is a space missing after the colon?"
    return f"unknown key{or_nearest(meant)}" if meant else f"unknown key, expected {one_of(model.model_fields)}"


def _owner_span(path: Path, document: Document) -> Any:
    owner = path[:-1]
    if owner and isinstance(owner[-1], str):
        return document.key_span(owner)
    node = document.node(owner)
    first = next(iter(node.entries.values()), None) if isinstance(node, MappingNode) else None
    # Keys that an item merges come from above it.
    return node.span if first is None or first.key < node.span._replace(width=0) else first.key
