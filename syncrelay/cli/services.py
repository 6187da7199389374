"""What the services of a running relay do."""

from collections.abc import Callable
from concurrent.futures import Future
from typing import TYPE_CHECKING

from syncrelay.cli.config_files import ConfigFiles
from syncrelay.status import RelayState, status_of

if TYPE_CHECKING:
    from syncrelay.ros.relay import Relay
    from syncrelay.ros.services import Offered


def services(relay: "Relay", files: ConfigFiles) -> "Offered":
    """Return the services of a relay whose files these are."""
    return {
        "reload": files.read_again,
        "status": lambda: _status(relay.state),
        "pause": lambda: relay.call(relay.pause),
        "resume": lambda: relay.call(relay.resume),
    }


def _status(state: Callable[[], RelayState]) -> "Future[str]":
    # What says it is imported when it is first asked for, which it may never be.
    from syncrelay.top.plain import summary

    told: Future[str] = Future()
    told.set_result(summary(status_of(state())))
    return told
