"""The JSON Schema of the file, from the models."""

from typing import Any

from syncrelay.config.file import File


def json_schema() -> dict[str, Any]:
    """Return the schema (draft 7)."""
    return File.model_json_schema()
