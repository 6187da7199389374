"""`syncrelay schema`: the JSON Schema of the file."""

import json
from argparse import Namespace

from syncrelay.cli.boundary import DONE, put
from syncrelay.cli.parser import Parser
from syncrelay.cli.stop import StopRequest
from syncrelay.config.schema import json_schema


def command(_parser: Parser, _arguments: Namespace, _stop: StopRequest) -> int:
    """Run `syncrelay schema`."""
    return schema()


def schema() -> int:
    """Print the JSON Schema (draft 7) of the file."""
    put(json.dumps(json_schema(), indent=2, ensure_ascii=False))
    return DONE
