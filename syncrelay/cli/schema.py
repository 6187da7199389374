"""`syncrelay schema`: the JSON Schema of the file, or of test files."""

import json
from argparse import Namespace

from syncrelay.cli.boundary import DONE, put
from syncrelay.cli.parser import Parser
from syncrelay.cli.stop import StopRequest
from syncrelay.config.schema import Schema, json_schema


def command(_parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    """Run `syncrelay schema`."""
    if arguments.test:
        from syncrelay.recordings.cases.schema import cases_schema

        return _print(cases_schema())
    return _print(json_schema())


def _print(schema: Schema) -> int:
    put(json.dumps(schema, indent=2, ensure_ascii=False))
    return DONE
