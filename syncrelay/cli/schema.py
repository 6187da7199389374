"""`syncrelay schema`: the JSON Schema of the file."""

import json

from syncrelay.cli.boundary import DONE, put
from syncrelay.config.schema import json_schema


def schema() -> int:
    """Print the JSON Schema (draft 7) of the file."""
    put(json.dumps(json_schema(), indent=2, ensure_ascii=False))
    return DONE
