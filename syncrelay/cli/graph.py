"""`syncrelay graph FILE...`: the groups of files as a drawing."""

from argparse import Namespace

from syncrelay.cli.boundary import DONE, put
from syncrelay.cli.parser import Parser
from syncrelay.cli.stop import StopRequest


def parser() -> Parser:
    parser = Parser(
        "syncrelay graph",
        example="syncrelay graph fusion.yaml",
        description="Draws the groups of files that run together: which inputs each matches, how, and its outputs. "
        "Needs no ROS.",
    )
    parser.add_argument("files", metavar="FILE", nargs="+", help="a YAML file, a directory of them, or -")
    parser.add_argument(
        "--format",
        choices=("mermaid", "text"),
        default="mermaid",
        metavar="FORMAT",
        help="mermaid (default), for Markdown pages and mermaid.live; text, for a terminal",
    )
    return parser


def command(parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    from syncrelay.config import load
    from syncrelay.config.graph import as_mermaid, as_text, drawing_of
    from syncrelay.config.source import shown_name

    parser.refuse_repeated(arguments.files)
    draw = as_text if arguments.format == "text" else as_mermaid
    put("\n".join(draw(drawing_of(load(*arguments.files), title=", ".join(map(shown_name, arguments.files))))))
    return DONE
