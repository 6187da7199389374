"""`syncrelay graph FILE...`: the groups of files as a drawing, with what a running relay says of them."""

from argparse import Namespace
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from syncrelay.cli.boundary import DONE, put, remark
from syncrelay.cli.graph.dot import as_dot
from syncrelay.cli.graph.drawing import Drawing, drawing_of
from syncrelay.cli.graph.mermaid import as_mermaid
from syncrelay.cli.graph.svg import as_svg
from syncrelay.cli.parser import Parser
from syncrelay.cli.stop import StopRequest
from syncrelay.config import Config, load
from syncrelay.config.source import shown_name
from syncrelay.config.wording import all_of

if TYPE_CHECKING:
    from syncrelay.status.document import Status

_FORMATS: Final = {"mermaid": as_mermaid, "dot": as_dot, "svg": as_svg}
_OTHERWISE: Final = "  Without --url, the files alone are drawn."


def command(parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    """Run `syncrelay graph`."""
    parser.refuse_repeated(arguments.files)
    return graph(arguments.files, arguments.format, arguments.url)


def graph(files: Sequence[str], output_format: str, url: str | None) -> int:
    """Print the groups of files that run together as `mermaid`, `dot` or `svg`; with the state of the relay at a URL.

    Raises ConfigError for a faulty file, and as `find_one` where no relay answers.
    """
    config = load(*files)
    put(_FORMATS[output_format](_drawing(config, files, url)).rstrip())
    return DONE


def _drawing(config: Config, files: Sequence[str], url: str | None) -> Drawing:
    title = ", ".join(map(shown_name, files))
    if url is None:
        return drawing_of(config, title=title)
    from syncrelay.cli.relays import find_one

    state = find_one(url, otherwise=_OTHERWISE).state
    _remark_on_others(config, state)
    return drawing_of(config, title=f"{title}, as {state.relay.node} runs it", state=state)


def _remark_on_others(config: Config, state: "Status") -> None:
    """Say where the relay runs other groups than the files have."""
    drawn, running = ({group.name for group in of.groups} for of in (config, state))
    if missing := sorted(drawn - running):
        remark(f"{state.relay.node} does not run {all_of(missing)}: drawn without figures")
    if others := sorted(running - drawn):
        remark(f"{state.relay.node} also runs {all_of(others)}: not drawn, as the files do not have them")
    for group in (each for each in state.groups if each.name in drawn):
        names = next(each.inputs.names for each in config.groups if each.name == group.name)
        if strange := [each.topic for each in group.inputs if each.topic not in names]:
            remark(
                f"{group.name} of {state.relay.node} matches {all_of(strange)}, which the files do not have there: a"
                " remap, or it runs another version of them"
            )
