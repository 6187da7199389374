"""`syncrelay test FILE...`: whether a configuration does what its tests say."""

import sys
from argparse import Namespace

from syncrelay.cli.boundary import AT_FAULT, DONE, put, remark, say, wants_colour
from syncrelay.cli.parser import Parser
from syncrelay.cli.stop import StopRequest


def parser() -> Parser:
    parser = Parser(
        "syncrelay test",
        example="syncrelay test tests/fusion.yaml",
        description="Runs the tests of a configuration, without ROS: messages that are drawn, simulated or recorded go "
        "through the engine, and what comes of them is compared with what the test file expects. Exit code 1 if a case "
        "fails.",
    )
    parser.add_argument(
        "files", metavar="FILE", nargs="+", help="a test file, a directory of them, or - for standard input"
    )
    parser.add_argument(
        "--format",
        choices=("text", "junit", "json", "github"),
        default="text",
        metavar="FORMAT",
        help="text (default), junit, json, or github: annotations for a workflow",
    )
    return parser


def command(parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    parser.refuse_repeated(arguments.files)
    from syncrelay.recordings.cases.checking import run_files
    from syncrelay.recordings.cases.reports import REPORTS, Talk, counts

    talk = Talk(put, say, remark, wants_colour(sys.stdout.isatty()), wants_colour(sys.stderr.isatty()))
    _, failed, errors = counts(REPORTS[arguments.format](run_files(arguments.files), talk))
    return AT_FAULT if failed or errors else DONE
