"""`syncrelay demo`: a simulated rig, relayed with a shipped file, drawn as it happens."""

import math
import os
import sys
import time
from argparse import Namespace
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from importlib.resources import files
from typing import TYPE_CHECKING, TypeAlias

from rich.console import Console
from rich.live import Live
from rich.text import Text

from syncrelay.cli.boundary import AT_FAULT, DONE, put, remark
from syncrelay.cli.demo_screen import Moment, frame, plain_line, summary
from syncrelay.cli.parser import Parser
from syncrelay.cli.stop import StopRequest
from syncrelay.config import load_text
from syncrelay.logs import configure, held_back
from syncrelay.status import status_of
from syncrelay.status.document import Status

if TYPE_CHECKING:
    from syncrelay.rig.processes import Rig
    from syncrelay.ros.relay import Relay

_STARTING = "Starting a simulated camera, lidar and IMU ..."
_FRAME_S = 0.125
_LINE_S = 1.0

Show: TypeAlias = Callable[[Moment], None]
"""Shows a moment, if it is time to."""


def shipped_config() -> str:
    """Return the text of the file that the demo relays."""
    return (files("syncrelay.cli") / "demo.yaml").read_text(encoding="utf-8")


def command(_parser: Parser, arguments: Namespace, stop: StopRequest) -> int:
    """Run `syncrelay demo`."""
    if arguments.record is not None:
        from syncrelay.cli.demo_recording import record

        return record(arguments.record, arguments.seconds, arguments.seed)
    return demo(arguments.seconds, arguments.seed, arguments.show_config, stop=stop)


def demo(seconds: float | None, seed: int, show_config: bool, *, stop: StopRequest) -> int:  # noqa: FBT001 - as parsed
    """Run the demo for a time, or until asked to stop; 0 if every group gave sets, 1 if not.

    With `show_config` the shipped file is printed and nothing runs. Raises RosUnavailableError where ROS
    cannot be used.
    """
    if show_config:
        sys.stdout.write(shipped_config())
        return DONE
    configure("warning", "text")
    prepare_ros()
    final = relay_rig(_view(Console(highlight=False)), total_s=seconds, seed=seed, stop=stop)
    if final is None:
        remark("stopped before it started")
        return DONE
    put(summary(final))
    return DONE if all(group.sets for group in final.state.groups) else AT_FAULT


def prepare_ros() -> None:
    """Import rclpy with this process kept to its machine; raises RosUnavailableError where ROS cannot be used."""
    from syncrelay.environment.domain import require_domain
    from syncrelay.ros.environment import require_rclpy

    os.environ.update(isolation(os.environ))
    require_domain(os.environ)
    require_rclpy()


def relay_rig(
    view: AbstractContextManager[Show], *, total_s: float | None, seed: int, stop: StopRequest
) -> Moment | None:
    """Start the rig, relay it and show every moment; return how it stood when all was drained.

    The view is left before the rig ends, which may take time and words. Time counts from when every sensor publishes:
    how long their start takes is the machine's affair. None if it was stopped before.
    """
    from syncrelay.environment.quick_discovery import quick_discovery
    from syncrelay.rig.processes import Rig

    stop.defer()
    with quick_discovery(), Rig(seed=seed) as rig, view as show:
        # Imported while the sensors start.
        from syncrelay.ros.relay import Relay

        config = load_text(shipped_config())
        while not stop.requested and not rig.is_up():
            time.sleep(_FRAME_S)
        if stop.requested:
            return None
        with Relay(config) as relay:
            return _relay(relay, rig, show, total_s=total_s, stop=stop)


def _relay(relay: "Relay", rig: "Rig", show: Show, *, total_s: float | None, stop: StopRequest) -> Moment:
    began = time.monotonic()
    end = math.inf if total_s is None else began + total_s

    def moment(state: Status) -> Moment:
        return Moment(state, time.monotonic() - began, total_s, time.time_ns())

    stop.wake_with(relay.wake)
    reports = relay.evaluate()
    state = status_of(relay.state())
    while not stop.requested and (left_s := end - time.monotonic()) > 0:
        relay.step(min(_FRAME_S, left_s))
        rig.check()
        if (told := relay.state()).groups != reports:
            reports, state = told.groups, status_of(told)
        show(moment(state))
    relay.drain()
    return moment(status_of(relay.state()))


def isolation(environ: Mapping[str, str]) -> dict[str, str]:
    """Return what to set in the environment so that the demo stays on this machine.

    It neither disturbs a robot on the network then nor is disturbed. Whoever has chosen a domain or a range
    for it wants it to be seen there.
    """
    chosen = "ROS_DOMAIN_ID" in environ or "ROS_AUTOMATIC_DISCOVERY_RANGE" in environ
    if chosen:
        return {}
    # Within the range of one host, Fast DDS delivers through shared memory only: its UDP alone, which the container
    # image chooses, finds peers and sends them nothing.
    return {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "FASTDDS_BUILTIN_TRANSPORTS": "DEFAULT"}


class _Screen:
    """The whole terminal, drawn anew at each moment."""

    def __init__(self, live: Live) -> None:
        self._live = live

    def show(self, moment: Moment) -> None:
        width, height = self._live.console.size
        self._live.update(frame(moment, width=width, height=height), refresh=True)


class _Lines:
    """A plain line, once a second."""

    def __init__(self) -> None:
        self._next_s = _LINE_S
        self._say(_STARTING)

    def show(self, moment: Moment) -> None:
        if moment.elapsed_s >= self._next_s:
            self._say(plain_line(moment))
            self._next_s = math.floor(moment.elapsed_s) + _LINE_S

    def _say(self, line: str) -> None:
        sys.stdout.write(f"{line}\n")
        sys.stdout.flush()


def _can_draw(console: Console) -> bool:
    # Not rich's is_terminal: FORCE_COLOR makes that true for a pipe.
    return sys.stdout.isatty() and not console.is_dumb_terminal and console.encoding.startswith("utf")


@contextmanager
def _view(console: Console) -> Iterator[Show]:
    if not _can_draw(console):
        yield _Lines().show
        return
    with held_back(), Live(Text(_STARTING), console=console, screen=True, auto_refresh=False) as live:
        yield _Screen(live).show
