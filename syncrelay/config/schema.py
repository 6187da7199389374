"""The JSON Schema of the file (draft 7, which editors read), made from the models.

pydantic's own schema is of a later draft, picks a group's model by OpenAPI's `discriminator`, and knows neither
`defaults`, which may hold what a group then lacks, nor variables, which may stand where a number is expected.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Final, TypeAlias

from syncrelay.config.document import EXTENSION
from syncrelay.config.file import file_format

Schema: TypeAlias = dict[str, Any]

ID: Final = "urn:syncrelay:schema:1"
"""The schema's name, wherever it is read from; it ends in the `version` of the files that it describes."""

DRAFT: Final = "http://json-schema.org/draft-07/schema#"
REF: Final = "#/definitions/"
"""What a reference to a definition begins with."""

VARIABLE: Final[Schema] = {
    "type": "string",
    "pattern": r"\$\{[A-Za-z_][A-Za-z0-9_]*(:-[^{}$]*)?\}",
    "description": "${NAME} or ${NAME:-default}, filled in from the environment.",
}
"""What may stand in place of any value."""

_EXTENSION: Final[Schema] = {"description": "Yours: syncrelay ignores it."}
# Keywords that describe a value of any type.
_ANNOTATIONS: Final = ("description", "default", "examples")


def json_schema() -> Schema:
    """Return the schema of a file."""
    form = file_format()
    generated = form.file.model_json_schema(ref_template=REF + "{model}")
    models: dict[str, Schema] = generated.pop("$defs")
    groups = generated["properties"]["groups"]
    # In the order of the union. Where two packages name a class alike, pydantic calls both by longer names.
    refs: list[str] = [each["$ref"] for each in groups["additionalProperties"]["oneOf"]]
    required = [_take_required(models[ref.removeprefix(REF)]) for ref in refs]
    groups["additionalProperties"] = {"$ref": f"{REF}Group"}
    return {
        "$schema": DRAFT,
        "$id": ID,
        "title": "syncrelay file",
        **of_mapping(generated),
        "if": {"not": {"required": ["defaults"]}},
        "then": {
            "properties": {
                "groups": {"additionalProperties": {"allOf": list(_without_defaults(form.groups, required))}}
            }
        },
        "definitions": {
            **{name: of_mapping(model) for name, model in models.items()},
            "Group": _by_policy(form.groups, refs),
            "Variable": VARIABLE,
        },
    }


def _take_required(group: Schema) -> list[str]:
    """Make `topics` the only required key of a group, and return the others, which may be in `defaults`."""
    required: list[str] = group["required"]
    group["required"] = ["topics"]
    return [key for key in required if key not in ("policy", "topics")]


def _by_policy(policies: Iterable[str], refs: Sequence[str]) -> Schema:
    """Return a group: by its policy's keys, or by those of all policies where it names none that is known."""
    *own, of_any = refs
    schema: Schema = {"$ref": of_any}
    for policy, ref in reversed([*zip(policies, own, strict=True)]):
        schema = {"if": _has_policy(policy), "then": {"$ref": ref}, "else": schema}
    return schema


def _without_defaults(policies: Iterable[str], required: Sequence[list[str]]) -> Iterator[Schema]:
    yield {"required": ["policy"]}
    for policy, keys in zip(policies, required, strict=False):
        if keys:
            yield {"if": _has_policy(policy), "then": {"required": keys}}


def _has_policy(policy: str) -> Schema:
    return {"required": ["policy"], "properties": {"policy": {"const": policy}}}


def of_mapping(model: Schema) -> Schema:
    """Return a model's schema with its keys in order."""
    properties = {key: _key(value) for key, value in model["properties"].items()}
    others = {key: value for key, value in model.items() if key != "title"}
    return {**others, "properties": properties, "patternProperties": {f"^{EXTENSION}": _EXTENSION}}


def _key(generated: Schema) -> Schema:
    said = {key: generated[key] for key in _ANNOTATIONS if generated.get(key) is not None}
    is_nullable = generated.pop("nullable", False)
    kinds = _kinds({key: value for key, value in generated.items() if key not in (*_ANNOTATIONS, "title")})
    if is_nullable:
        kinds.append({"type": "null"})
    if any(_is_written_as_one_word(kind) for kind in kinds):
        kinds.append({"$ref": f"{REF}Variable"})
    if len(kinds) > 1:
        return {**said, "anyOf": kinds}
    # Draft 7 passes over all that stands beside a $ref.
    return {**said, "allOf": kinds} if "$ref" in kinds[0] else {**said, **kinds[0]}


def _kinds(schema: Schema) -> list[Schema]:
    """Return the kinds of value that a key may have. None is in most models for keys that are absent."""
    union: list[Schema] = schema.get("anyOf") or schema.get("oneOf") or [schema]
    return [kind for kind in union if kind.get("type") != "null"]


def _is_written_as_one_word(kind: Schema) -> bool:
    """Return whether `${NAME}` in place of such a value needs a schema of its own."""
    return kind.get("type") in ("integer", "number", "boolean") or (kind.get("type") == "string" and len(kind) > 1)
