"""`syncrelay reload`: have a running relay of this machine read its file again."""

import json
import os
import signal
import time
from pathlib import Path
from typing import Any, Final

from syncrelay.cli.boundary import AT_FAULT, DONE, put, say
from syncrelay.errors import SyncRelayError
from syncrelay.top.client import NoAnswerError, ask, base_urls, search

# Reading a file takes milliseconds; a relay that is busy turns to it within a second or two.
_PATIENCE_S: Final = 10.0
_POLL_S: Final = 0.1


def reload(named: str | None) -> int:
    """Signal the relay and wait until it has read its file; 1 if it left the file aside.

    Raises SyncRelayError where no relay, or more than one, or one of another machine is found.
    """
    url = _the_one(named)
    before = _relay(url)
    _signal(int(before["pid"]))
    end = time.monotonic() + _PATIENCE_S
    while time.monotonic() < end:
        time.sleep(_POLL_S)
        now = _relay(url)
        if now["reloads"] != before["reloads"]:
            put(f"{now['node']} has read {now['config']} again")
            return DONE
        if now["refused_reloads"] != before["refused_reloads"]:
            say(f"{now['node']} goes on as before, its file is left aside:\n{now['reload_error']}")
            return AT_FAULT
    raise SyncRelayError(f"{before['node']} has not read its file within {_PATIENCE_S:.0f} s")


def _the_one(named: str | None) -> str:
    found = search(base_urls(named)).relays
    if not found:
        raise SyncRelayError("no relay answers here: send SIGHUP to its process where it has `metrics: null`")
    if len(found) > 1:
        raise SyncRelayError(
            f"several relays run here, name one: --url {' or --url '.join(each.url for each in found)}"
        )
    return found[0].url


def _relay(url: str) -> dict[str, Any]:
    try:
        return dict(json.loads(ask(url).document)["relay"])
    except NoAnswerError as error:
        raise SyncRelayError(f"the relay at {url} is gone: {error}") from error


def _signal(pid: int) -> None:
    """Signal a relay; the number may be of another container or machine, where it is something else here."""
    elsewhere = "it runs in a container or on another machine: `docker kill --signal=HUP` there does the same"
    try:
        words = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
    except OSError:
        words = []
    if not any(b"syncrelay" in word for word in words) or not any(word.startswith(b"--config") for word in words):
        raise SyncRelayError(f"process {pid} is not the relay here; {elsewhere}")
    try:
        os.kill(pid, signal.SIGHUP)
    except PermissionError as error:
        raise SyncRelayError(f"the relay is another user's: process {pid} takes no signal from this one") from error
