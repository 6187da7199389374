"""Runs a relay until the end is asked for: its turns, reloads of its files, and its services."""

import logging
import traceback
from collections.abc import Callable
from concurrent.futures import Future
from typing import Protocol

from syncrelay.config import Config
from syncrelay.config.rereading import ConfigFiles, Reading
from syncrelay.errors import ReloadError, SyncRelayError
from syncrelay.relay.relay import Relay
from syncrelay.relay.services import Offered
from syncrelay.runtime import SYSTEM, Runtime

_LOG = logging.getLogger("syncrelay")

_FAILED = "reload failed; keeping the running configuration:"
_FAILED_WITHOUT_GROUPS = "reload failed; no groups are running:"
_BUG = (
    "reload failed because of a bug in syncrelay; keeping the running configuration;"
    " please report it with these lines and the file:"
)


class Asked(Protocol):
    """What a process is asked for from outside, as by signals."""

    @property
    def requested(self) -> bool:
        """Whether the end was asked for."""
        ...

    def take_reload(self) -> bool:
        """Whether a reload was asked for since this was last called."""
        ...


def services(relay: Relay, files: ConfigFiles, status: Callable[[], str], *, runtime: Runtime = SYSTEM) -> Offered:
    """Return what the relay's node offers; `status` says in words how it stands."""

    def told() -> Future[str]:
        future: Future[str] = runtime.future()
        future.set_result(status())
        return future

    return {
        "reload": files.read_again,
        "status": told,
        "pause": lambda: relay.call(relay.pause),
        "resume": lambda: relay.call(relay.resume),
    }


def run(relay: Relay, files: ConfigFiles, asked: Asked, *, require: Callable[[Config], None]) -> None:
    """Take the relay's turns until the end is asked for, and run what its files say whenever they were read again.

    `require` raises a SyncRelayError for a file that lacks what the command line asks for.
    """
    while not asked.requested:
        relay.step()
        if asked.take_reload():
            files.read_again()
        if (read := files.take()) is not None:
            _reload(relay, read, require)


def _reload(relay: Relay, read: Reading, require: Callable[[Config], None]) -> None:
    """Apply the files that were read again; if anything is wrong with them, the relay keeps its configuration."""
    try:
        config = read.config.result()
        require(config)
        changed = relay.reload(config)
    except SyncRelayError as error:
        refusal = f"{_FAILED if relay.groups else _FAILED_WITHOUT_GROUPS}\n{error}"
        _LOG.error("%s", refusal)
        relay.refuse_reload(error.outline)
    except Exception as error:  # noqa: BLE001  a bug that a file triggers must not end the running relay
        refusal = f"{_BUG}\n{''.join(traceback.format_exception(error)).rstrip()}"
        _LOG.exception("%s", _BUG)
        relay.refuse_reload(f"reload failed because of a bug in syncrelay, {type(error).__name__}; see the relay's log")
    else:
        for each in read.asked:
            each.set_result(changed)
        return
    for each in read.asked:
        each.set_exception(ReloadError(refusal))
