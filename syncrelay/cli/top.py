"""`syncrelay top`: a running relay on the terminal, or once as text."""

import json
import os
import sys
from argparse import Namespace
from typing import TYPE_CHECKING, TextIO

from syncrelay.cli.boundary import DONE, put
from syncrelay.cli.commands import is_installed, line_to_install
from syncrelay.cli.parser import Parser
from syncrelay.cli.stop import StopRequest
from syncrelay.errors import SyncRelayError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from syncrelay.top.client import Answer


def parser() -> Parser:
    parser = Parser(
        "syncrelay top",
        example="syncrelay top --url robot:9464",
        description="Shows a running relay live: its groups, their inputs, their last sets, and what is wrong. "
        "Without --url it shows the relay of this machine, and asks which if there are several. "
        "Exit code 1 if no relay answers.",
    )
    parser.add_argument(
        "--url", metavar="URL", help="the relay's host, host:port or URL, such as robot or http://robot:9464"
    )
    parser.add_argument("--once", action="store_true", help="print the state once as text, and exit")
    parser.add_argument("--json", action="store_true", help="with --once: print the state as JSON")
    return parser


def command(parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    if arguments.json and not arguments.once:
        parser.error("--json goes with --once")
    from syncrelay.cli.relays import find, find_one, otherwise
    from syncrelay.top.client import ask, base_urls
    from syncrelay.top.plain import plain_text

    named = arguments.url
    if not arguments.once:
        # What is no name of a relay is said with or without a terminal.
        base_urls(named)
        if (why := why_no_screen()) is not None:
            raise SyncRelayError(f"{why}\n  `syncrelay top --once` prints text")
        show(find(named, otherwise=otherwise(named)), ask)
        return DONE
    answer = find_one(named, otherwise=otherwise(named))
    # Written anew: JSON may hold as they are what a terminal must not see.
    put(json.dumps(json.loads(answer.document)) if arguments.json else plain_text(answer))
    return DONE


def show(relays: "Sequence[Answer]", source: "Callable[[str], Answer]") -> None:
    """Show relays on the terminal until the user has seen enough, or `source`, as TopApp takes it, ends."""
    from syncrelay.top.app import TopApp, end_with_terminal

    end_with_terminal()
    app = TopApp(relays, source=source)
    app.run()
    if app.failure is not None:
        raise app.failure


def why_no_screen() -> str | None:
    """Say why nothing can be drawn here, None if it can."""
    if not is_installed("top"):
        return f"top needs packages that are not installed here\n  {line_to_install('top')}"
    # Keys come from stdin and the screen goes to stderr; who redirects stdout wants text.
    if not all(stream.isatty() for stream in (sys.stdin, sys.stdout, sys.stderr)):
        return "top needs a terminal, and there is none here"
    if not can_draw(sys.stderr):
        return "top cannot draw on this terminal: check TERM and LANG"
    return None


def can_draw(stream: TextIO) -> bool:
    """Tell whether a stream is a terminal that draws."""
    # Not rich's is_terminal: FORCE_COLOR makes that true for a pipe.
    is_terminal = stream.isatty() and os.environ.get("TERM", "dumb") not in {"dumb", "unknown"}
    return is_terminal and stream.encoding.lower().startswith("utf")
