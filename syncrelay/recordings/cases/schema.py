"""The JSON Schema of test files (draft 7, which editors read), made from the models."""

from typing import Any, Final

from syncrelay.config.schema import DRAFT, REF, VARIABLE, Schema, of_mapping
from syncrelay.recordings.cases.models import CasesFile

ID: Final = "urn:syncrelay:schema:test:1"
"""The schema's name; it ends in the `version` of the files that it describes."""


def cases_schema() -> Schema:
    """Return the schema of a test file."""
    generated: dict[str, Any] = CasesFile.model_json_schema(ref_template=REF + "{model}")
    models: dict[str, Schema] = generated.pop("$defs")
    return {
        "$schema": DRAFT,
        "$id": ID,
        "title": "syncrelay test file",
        **of_mapping(generated),
        "definitions": {**{name: of_mapping(model) for name, model in models.items()}, "Variable": VARIABLE},
    }
