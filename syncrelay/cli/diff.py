"""`syncrelay diff OLD NEW`: what a reload from one file to another would do."""

import json
from argparse import Namespace

from syncrelay.cli.boundary import AT_FAULT, DONE, put
from syncrelay.cli.parser import Parser
from syncrelay.cli.stop import StopRequest


def parser() -> Parser:
    parser = Parser(
        "syncrelay diff",
        example="syncrelay diff fusion.yaml wider.yaml",
        description="Says what a reload would do to a relay that runs OLD and reads NEW: which groups go on, are "
        "rebuilt, start and end, and for which keys. Needs no ROS. "
        "For files that run together, name a directory of them. "
        "Exit code 0 if nothing changes, 1 if something does or a file has an error.",
    )
    parser.add_argument("old", metavar="OLD", help="what the relay runs: a YAML file, a directory of them, or -")
    parser.add_argument("new", metavar="NEW", help="what it would read: a YAML file, a directory of them, or -")
    parser.add_argument("--json", action="store_true", help="print JSON, for programs")
    return parser


def command(parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    """Run `syncrelay diff`. Raises ConfigError with what is wrong with either file."""
    from syncrelay.config import Config, ConfigError, Problem, load
    from syncrelay.config.difference import difference, difference_as_json, difference_lines

    if arguments.old == arguments.new == "-":
        parser.error("standard input can be read only once")
    configs: list[Config] = []
    problems: list[Problem] = []
    for file in (arguments.old, arguments.new):
        try:
            configs.append(load(file))
        except ConfigError as error:
            problems += error.problems
    if problems:
        raise ConfigError(problems)
    found = difference(*configs)
    if arguments.json:
        put(json.dumps(difference_as_json(found), indent=2, ensure_ascii=False))
    else:
        put("\n".join(difference_lines(found)))
    return DONE if found.is_empty else AT_FAULT
