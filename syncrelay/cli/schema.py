"""`syncrelay schema`: the JSON Schema of the file."""

import json
from collections.abc import Sequence

from syncrelay.cli import parsers
from syncrelay.cli.boundary import DONE, put
from syncrelay.cli.stop import StopRequest
from syncrelay.config.schema import json_schema


def command(words: Sequence[str], _stop: StopRequest) -> int:
    """Run `syncrelay schema`."""
    parsers.schema().read(words)
    return schema()


def schema() -> int:
    """Print the JSON Schema (draft 7) of the file."""
    put(json.dumps(json_schema(), indent=2, ensure_ascii=False))
    return DONE
