"""The options of every command that goes over many recordings. Imports nothing slow, as parsers.py says."""

from syncrelay.cli.parser import Parser, count


def add_fleet_options(parser: Parser, *into: str) -> None:
    """Add what says where the results of many recordings go and what works on them.

    `into` are the option strings of the folder, `--into` by default.
    """
    add = parser.add_argument_group("many recordings").add_argument
    add(
        *(into or ("--into",)),
        dest="into",
        metavar="FOLDER",
        help="do each recording by itself, each with a folder in FOLDER, and only those that are not done yet; BAG is"
        " then also a pattern, a folder of recordings, a URL, or @FILE that lists them",
    )
    add(
        "--engine",
        choices=("local", "ray"),
        default="local",
        metavar="ENGINE",
        help="local (default): this machine's cores; ray: the cluster that RAY_ADDRESS names, else one started here",
    )
    add("--jobs", metavar="N", type=count, help="recordings at a time; default: one for each core")
    add("--strict", action="store_true", help="end at the first recording that is at fault")
    add("--overwrite", action="store_true", help="replace what FOLDER holds of another file, version or options")
