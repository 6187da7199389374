"""`syncrelay reload`: have a running relay of this machine read its file again."""

import os
import signal
import time
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Final

from syncrelay.cli.boundary import AT_FAULT, DONE, put, say
from syncrelay.cli.parser import Parser
from syncrelay.cli.stop import StopRequest
from syncrelay.errors import SyncRelayError
from syncrelay.printable import one_entry, printable

if TYPE_CHECKING:
    from syncrelay.status.document import Relay

# Reading a file takes milliseconds; a relay that is busy turns to it within a second or two.
_PATIENCE_S: Final = 10.0
_POLL_S: Final = 0.1
_OTHERWISE: Final = "  If the relay's file says `metrics: null`, send SIGHUP to its process"


def parser() -> Parser:
    parser = Parser(
        "syncrelay reload",
        example="syncrelay reload --url localhost:9464",
        description="Makes the relay on this machine read its file again. Groups that did not change keep running and "
        "lose nothing. If the file has an error, the relay keeps its running configuration: exit code 1.",
    )
    parser.add_argument("--url", metavar="URL", help="which relay, if there are several: its host, host:port or URL")
    return parser


def command(_parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    """Run `syncrelay reload`: signal the relay and wait until it has read its file; 1 if it kept its configuration.

    Raises SyncRelayError where no relay, or more than one, or one of another machine is found.
    """
    from syncrelay.cli.relays import find_one

    url = find_one(arguments.url, otherwise=_OTHERWISE).url
    before = _relay(url)
    _signal(before.pid)
    end = time.monotonic() + _PATIENCE_S
    while time.monotonic() < end:
        time.sleep(_POLL_S)
        now = _relay(url)
        if now.reloads != before.reloads:
            put(printable(f"{now.node} has read {now.config} again"))
            return DONE
        if now.refused_reloads != before.refused_reloads:
            say(one_entry(f"{now.node}: reload failed; it keeps its running configuration:\n{now.reload_error}"))
            return AT_FAULT
    raise SyncRelayError(f"{before.node} did not read its file again within {_PATIENCE_S:.0f} s")


def _relay(url: str) -> "Relay":
    from syncrelay.top.client import NoAnswerError, OtherServerError, ask

    try:
        return ask(url).status.relay
    except (NoAnswerError, OtherServerError) as error:
        raise SyncRelayError(f"the relay at {url} is gone: {error}") from error


def _signal(pid: int) -> None:
    """Signal a relay; the number may be of another container or machine, where it is something else here."""
    elsewhere = "it runs in a container or on another machine; use `docker kill --signal=HUP` there"
    try:
        words = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
    except OSError:
        words = []
    if not any(b"syncrelay" in word for word in words) or not any(word.startswith(b"--config") for word in words):
        raise SyncRelayError(f"process {pid} is not the relay: {elsewhere}")
    try:
        os.kill(pid, signal.SIGHUP)
    except PermissionError as error:
        raise SyncRelayError(
            f"process {pid} of the relay belongs to another user, and only that user may signal it"
        ) from error
