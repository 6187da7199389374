"""`syncrelay top`: a running relay on the terminal, or once as text."""

import json
import os
import sys
from enum import Enum

from syncrelay.cli.boundary import AT_FAULT, DONE, put, remark
from syncrelay.errors import SyncRelayError
from syncrelay.top.client import FIRST_PORT, LAST_PORT, Answer, Search, base_urls, search


class Output(Enum):
    """What the state becomes."""

    SCREEN = "screen"
    TEXT = "text"
    JSON = "json"


def top(named: str | None, output: Output) -> int:
    """Show the state of a relay on this machine, or of one that is named by host, host:port or URL.

    1 if there is no relay, or several where one can't be chosen. Raises UsageError for a name that is none.
    """
    urls = base_urls(named)
    if output is Output.SCREEN:
        _require_terminal()
    found = search(urls)
    if not found.relays:
        remark(_nothing_there(named, found))
        return AT_FAULT
    if output is Output.SCREEN:
        return _screen(found)
    if len(found.relays) > 1:
        remark(_several(found))
        return AT_FAULT
    (answer,) = found.relays
    # Made anew: JSON may hold as they are what a terminal must not see.
    put(json.dumps(json.loads(answer.document)) if output is Output.JSON else _as_text(answer))
    return DONE


def _as_text(answer: Answer) -> str:
    from syncrelay.top.plain import plain_text

    return plain_text(answer)


def _screen(found: Search) -> int:
    from syncrelay.top.app import TopApp

    app = TopApp(found.relays)
    app.run()
    if app.failure is not None:
        raise app.failure
    return DONE


def _require_terminal() -> None:
    # Keys come from stdin and the screen goes to stderr; who redirects stdout wants text.
    streams = (sys.stdin, sys.stdout, sys.stderr)
    if not all(stream.isatty() for stream in streams):
        raise SyncRelayError("top draws on a terminal, and here is none\n  `syncrelay top --once` prints text")
    if os.environ.get("TERM", "dumb") in {"dumb", "unknown"} or not sys.stderr.encoding.lower().startswith("utf"):
        raise SyncRelayError(
            "this terminal cannot be drawn on: see TERM and LANG\n  `syncrelay top --once` prints text"
        )


def _nothing_there(named: str | None, found: Search) -> str:
    # Of a machine whose name is not known, or that is off, all ports say the same.
    reasons = {text.partition(": ")[2]: text for text in reversed(found.others)}
    others = "".join(f"\n  {text}" for text in reversed(reasons.values()))
    if named is None:
        return (
            f"no relay answers on this machine, at 127.0.0.1:{FIRST_PORT} to {LAST_PORT}{others}\n"
            "  Start one with `syncrelay --config FILE`, whose file must not say\n"
            "  `metrics: null`, or say where it is: `syncrelay top --url robot:9464`."
        )
    return (
        f"no relay answers at {named}{others}\n"
        "  From other machines a relay can be asked if its file says\n"
        "  `metrics: {listen: 0.0.0.0:9464}` and no firewall is in between."
    )


def _several(found: Search) -> str:
    lines = "".join(
        f"\n  --url {answer.url}   {answer.state.relay.node}: {', '.join(group.name for group in answer.state.groups)}"
        for answer in found.relays
    )
    return f"{len(found.relays)} relays answer; choose one{lines}"
