"""The options of every command that goes over many recordings. Imports nothing slow."""

from argparse import Namespace

from syncrelay.cli.parser import Parser, count, duration


def add_fleet_options(parser: Parser, *into: str) -> None:
    """Add what says where the results of many recordings go and what works on them.

    `into` are the option strings of the folder, `--into` by default.
    """
    add = parser.add_argument_group("many recordings").add_argument
    add(
        *(into or ("--into",)),
        dest="into",
        metavar="FOLDER",
        help="do each recording by itself, unless its result is in FOLDER already; BAG may be a pattern, a folder, a"
        " URL, or @FILE that lists them",
    )
    add(
        "--engine",
        choices=("local", "ray"),
        default="local",
        metavar="ENGINE",
        help="local (default), or ray, at RAY_ADDRESS or here",
    )
    add("--jobs", metavar="N", type=count, help="recordings at a time; default: one for each core")
    add(
        "--time-limit",
        metavar="TIME",
        type=duration,
        help="give up a recording after TIME, such as 90min; default: 10 min and 10 s for each MB",
    )
    add("--strict", action="store_true", help="end at the first recording that is at fault")
    add("--overwrite", action="store_true", help="replace results that other values or options gave")


def require_into(parser: Parser, arguments: Namespace) -> None:
    """Refuse options that only go with a folder for many results."""
    if arguments.into is None:
        for name in ("strict", "overwrite", "time_limit"):
            if getattr(arguments, name):
                parser.error(f"--{name.replace('_', '-')} goes with --into")
        if arguments.jobs is not None:
            parser.error("--jobs goes with --into")
        if arguments.engine != "local":
            parser.error("--engine goes with --into")
