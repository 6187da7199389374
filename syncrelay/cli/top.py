"""`syncrelay top`: a running relay on the terminal, or once as text."""

import json
import os
import sys
from argparse import Namespace
from collections.abc import Callable, Sequence
from enum import Enum

from syncrelay.cli.boundary import DONE, put
from syncrelay.cli.parser import Parser
from syncrelay.cli.relays import find, find_one, otherwise
from syncrelay.cli.stop import StopRequest
from syncrelay.errors import SyncRelayError
from syncrelay.top.client import Answer, ask, base_urls


class Output(Enum):
    """What the state becomes."""

    SCREEN = "screen"
    TEXT = "text"
    JSON = "json"


def command(parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    """Run `syncrelay top`."""
    if arguments.json and not arguments.once:
        parser.error("--json goes with --once")
    return top(arguments.url, Output.JSON if arguments.json else Output.TEXT if arguments.once else Output.SCREEN)


def top(named: str | None, output: Output) -> int:
    """Show the state of a relay on this machine, or of one that is named by host, host:port or URL.

    Raises SyncRelayError where there is none, or several of which none can be chosen, and UsageError for a wrong name.
    """
    if output is Output.SCREEN:
        # What is no name of a relay is said with or without a terminal.
        base_urls(named)
        _require_terminal()
        show(find(named, otherwise=otherwise(named)))
        return DONE
    answer = find_one(named, otherwise=otherwise(named))
    # Made anew: JSON may hold as they are what a terminal must not see.
    put(json.dumps(json.loads(answer.document)) if output is Output.JSON else _as_text(answer))
    return DONE


def _as_text(answer: Answer) -> str:
    from syncrelay.top.plain import plain_text

    return plain_text(answer)


def show(relays: Sequence[Answer], source: Callable[[str], Answer] = ask) -> None:
    """Show relays on the terminal until the user has seen enough, or `source`, as TopApp takes it, ends."""
    from syncrelay.top.app import TopApp, end_with_terminal

    end_with_terminal()
    app = TopApp(relays, source=source)
    app.run()
    if app.failure is not None:
        raise app.failure


def _require_terminal() -> None:
    if (why := why_no_screen()) is not None:
        raise SyncRelayError(f"{why}\n  `syncrelay top --once` prints text")


def why_no_screen() -> str | None:
    """Say why nothing can be drawn here, None if it can."""
    # Keys come from stdin and the screen goes to stderr; who redirects stdout wants text.
    if not all(stream.isatty() for stream in (sys.stdin, sys.stdout, sys.stderr)):
        return "top needs a terminal, and there is none here"
    if os.environ.get("TERM", "dumb") in {"dumb", "unknown"} or not sys.stderr.encoding.lower().startswith("utf"):
        return "top cannot draw on this terminal: check TERM and LANG"
    return None
