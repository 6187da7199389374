"""The options of every command that goes over many recordings. Imports nothing slow."""

from syncrelay.cli.parser import Parser, count, duration


def add_many_options(parser: Parser) -> None:
    """Add what says what works on many recordings, and for how long."""
    add = parser.add_argument_group("many recordings").add_argument
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
