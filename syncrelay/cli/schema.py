"""`syncrelay schema`: the JSON Schema of the file, or of test files."""

import json
from argparse import Namespace

from syncrelay.cli.boundary import DONE, put, remark
from syncrelay.cli.parser import Parser
from syncrelay.cli.stop import StopRequest


def parser() -> Parser:
    parser = Parser(
        "syncrelay schema",
        example="syncrelay schema > syncrelay.json",
        description="Prints the JSON Schema (draft 7) of the file: with it, editors complete and check what you write.",
    )
    parser.add_argument("--test", action="store_true", help="print that of test files, see syncrelay test")
    return parser


def command(_parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    if arguments.test:
        from syncrelay.recordings.cases.models import cases_schema

        schema = cases_schema()
    else:
        from syncrelay.config.installed import installed_policies
        from syncrelay.config.schema import json_schema

        schema = json_schema()
        for why in installed_policies().refused.values():
            remark(why)
    put(json.dumps(schema, indent=2, ensure_ascii=False))
    return DONE
