"""`syncrelay doctor`: what can go wrong before a message flows."""

import json
import os
import sys
from argparse import Namespace
from logging import NullHandler

from syncrelay.cli.boundary import AT_FAULT, DONE, put, say, wants_colour
from syncrelay.cli.parser import Parser, positive
from syncrelay.cli.stop import StopRequest


def parser() -> Parser:
    parser = Parser(
        "syncrelay doctor",
        example="syncrelay doctor --config fusion.yaml --live",
        description="Finds out why messages may not arrive: what is wrong, what follows from it, how to fix it. "
        "Exit code 1 if something must be fixed.",
    )
    parser.add_repeatable(
        "--config",
        metavar="FILE",
        help="check FILE or the files of a directory too, and whether their types can be used here",
    )
    parser.add_argument(
        "--live",
        action="store_true",
        help="join the ROS graph and check the topics of FILE: publishers, types, QoS, stamps",
    )
    parser.add_argument("--seconds", metavar="N", type=positive, help="with --live: watch for N s (5)")
    parser.add_argument("--json", action="store_true", help="print JSON, for programs")
    parser.add_argument("--ros-args", action="store_true", help="ROS arguments as the relay gets them, such as remaps")
    return parser


def command(parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    if arguments.seconds and not arguments.live:
        parser.error("--seconds N needs --live: it is how long to observe the graph")
    parser.refuse_repeated(arguments.config)
    from syncrelay.doctor.examine import examine
    from syncrelay.doctor.report import as_json, is_ok, lines
    from syncrelay.logs import LOGGER

    live_s = (arguments.seconds or 5.0) if arguments.live else None
    if live_s is not None and sys.stderr.isatty():
        say(f"observing the graph for {live_s:g} s ...")
    # What the relay that observes would log is printed as findings.
    LOGGER.addHandler(NullHandler())
    examination = examine(os.environ, files=arguments.config, ros_args=arguments.ros_args, live_s=live_s)
    if arguments.json:
        put(json.dumps(as_json(examination), indent=2))
    else:
        put("\n".join(lines(examination, colour=wants_colour(sys.stdout.isatty()))))
    return DONE if is_ok(examination) else AT_FAULT
