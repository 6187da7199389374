"""`syncrelay graph FILE...`: the groups of files as a drawing, with what a running relay says of them."""

from argparse import Namespace
from typing import TYPE_CHECKING

from syncrelay.cli.boundary import DONE, put, remark
from syncrelay.cli.parser import Parser
from syncrelay.cli.stop import StopRequest

if TYPE_CHECKING:
    from syncrelay.config import Config
    from syncrelay.status.document import Status


def parser() -> Parser:
    """Return the parser of `syncrelay graph`."""
    parser = Parser(
        "syncrelay graph",
        example="syncrelay graph fusion.yaml",
        description="Draws the groups of files that run together: which inputs each matches, how, and its outputs. "
        "With --url the drawing has what a running relay says: rates and findings. Needs no ROS.",
    )
    parser.add_argument("files", metavar="FILE", nargs="+", help="a YAML file, a directory of them, or -")
    parser.add_argument(
        "--format",
        choices=("mermaid", "text"),
        default="mermaid",
        metavar="FORMAT",
        help="mermaid (default), for Markdown pages and mermaid.live; text, for a terminal",
    )
    parser.add_argument("--url", metavar="URL", help="the relay that runs them: its host, host:port or URL")
    return parser


def command(parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    """Run `syncrelay graph`."""
    from syncrelay.cli.relays import find_one
    from syncrelay.config import load
    from syncrelay.config.source import shown_name
    from syncrelay.top.graph import as_mermaid, as_text, drawing_of

    parser.refuse_repeated(arguments.files)
    config = load(*arguments.files)
    title, status = ", ".join(map(shown_name, arguments.files)), None
    if arguments.url is not None:
        status = find_one(arguments.url, otherwise="  Without --url, the files alone are drawn.").status
        _remark_on_others(config, status)
        title = f"{title}, as {status.relay.node} runs it"
    draw = as_text if arguments.format == "text" else as_mermaid
    put("\n".join(draw(drawing_of(config, title=title, status=status))))
    return DONE


def _remark_on_others(config: "Config", status: "Status") -> None:
    """Say where the relay runs other groups than the files have."""
    from syncrelay.config.wording import all_of

    drawn, running = ({group.name for group in of.groups} for of in (config, status))
    if missing := sorted(drawn - running):
        remark(f"{status.relay.node} does not run {all_of(missing)}: drawn without figures")
    if others := sorted(running - drawn):
        remark(f"{status.relay.node} also runs {all_of(others)}: not drawn, as the files do not have them")
    for group in (each for each in status.groups if each.name in drawn):
        names = next(each.inputs.names for each in config.groups if each.name == group.name)
        if strange := [each.topic for each in group.inputs if each.topic not in names]:
            remark(
                f"{group.name} of {status.relay.node} matches {all_of(strange)}, which the files do not have there: a"
                " remap, or it runs another version of them"
            )
