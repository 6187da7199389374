"""`syncrelay demo`: a simulated rig, relayed with a shipped file, drawn as it happens."""

import math
import os
import sys
import time
from argparse import Namespace
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from importlib.resources import files
from typing import TYPE_CHECKING, Final, TypeAlias

from syncrelay.cli.boundary import AT_FAULT, DONE, put, remark
from syncrelay.cli.commands import is_installed, line_to_install
from syncrelay.cli.parser import Parser, positive, seed
from syncrelay.cli.stop import StopRequest
from syncrelay.cli.top import can_draw
from syncrelay.printable import printable

if TYPE_CHECKING:
    from syncrelay.relay.relay import Relay
    from syncrelay.rig.processes import Rig
    from syncrelay.status.document import Status
    from syncrelay.top.plain import Moment

_STARTING: Final = "Starting a simulated camera, lidar and IMU ..."
_FRAME_S: Final = 0.125
_LINE_S: Final = 1.0
_RECORDED_S: Final = 30.0
_SECOND: Final = 1_000_000_000
# The stamp of the first message: always the same, so that equal seeds give equal recordings.
_START: Final = 1_767_225_600 * _SECOND
# How long a message takes from its publisher to the recorder.
_ON_THE_WAY: Final = 500_000

Show: TypeAlias = "Callable[[Moment], None]"
"""Shows a moment, if it is time to."""


def parser() -> Parser:
    parser = Parser(
        "syncrelay demo",
        example="syncrelay demo --seconds 30",
        description="Starts a simulated camera, lidar and IMU, relays them, and draws what happens. Ctrl-C ends it. "
        "Exit code 1 if a group produced no set.",
    )
    parser.add_argument("--seconds", metavar="N", type=positive, help="end N seconds after the sensors are up")
    parser.add_argument("--seed", metavar="N", type=seed, default=0, help="seed of jitter, latency and drops (0)")
    parser.add_argument("--show-config", action="store_true", help="print the file that the demo relays, and exit")
    parser.add_argument(
        "--record",
        metavar="OUT",
        help="write what the sensors send in N seconds (30) as a recording, at once and without ROS: OUT.mcap, or OUT"
        " as a rosbag2 folder",
    )
    return parser


def command(_parser: Parser, arguments: Namespace, stop: StopRequest) -> int:
    """Run `syncrelay demo`: 0 if every group gave sets, 1 if not."""
    if arguments.record is not None:
        return record(arguments.record, arguments.seconds or _RECORDED_S, arguments.seed)
    if arguments.show_config:
        sys.stdout.write(shipped_config())
        return DONE
    from syncrelay.logs import configure
    from syncrelay.top.plain import summary_of

    configure("warning", "text")
    prepare_ros()
    final = relay_rig(_view(), total_s=arguments.seconds, seed=arguments.seed, stop=stop)
    if final is None:
        remark("stopped before it started")
        return DONE
    put(summary_of(final))
    return DONE if all(group.sets for group in final.state.groups) else AT_FAULT


def shipped_config() -> str:
    """Return the text of the file that the demo relays."""
    return (files("syncrelay.cli") / "demo.yaml").read_text(encoding="utf-8")


def prepare_ros() -> None:
    """Import rclpy with this process kept to its machine; raises RosUnavailableError where ROS cannot be used."""
    from syncrelay.environment.domain import require_domain
    from syncrelay.ros.environment import require_rclpy

    os.environ.update(isolation(os.environ))
    require_domain(os.environ)
    require_rclpy()


def relay_rig(
    view: AbstractContextManager[Show], *, total_s: float | None, seed: int, stop: StopRequest
) -> "Moment | None":
    """Start the rig, relay it and show every moment; return how it stood when all was drained.

    The view is left before the rig ends, which may take time and words. Time counts from when every sensor publishes:
    how long their start takes is the machine's affair. None if it was stopped before.
    """
    from syncrelay.config import load_text
    from syncrelay.environment.quick_discovery import quick_discovery
    from syncrelay.rig.processes import Rig

    stop.defer()
    with quick_discovery(), Rig(seed=seed) as rig, view as show:
        # Imported while the sensors start.
        from syncrelay.relay.relay import Relay
        from syncrelay.ros.joining import joined

        config = load_text(shipped_config())
        while not stop.requested and not rig.is_up():
            time.sleep(_FRAME_S)
        if stop.requested:
            return None
        with Relay(config, *joined(config)) as relay:
            return _relay(relay, rig, show, total_s=total_s, stop=stop)


def _relay(relay: "Relay", rig: "Rig", show: Show, *, total_s: float | None, stop: StopRequest) -> "Moment":
    from syncrelay.status.as_document import status_of
    from syncrelay.top.plain import Moment

    began = time.monotonic()
    end = math.inf if total_s is None else began + total_s

    def moment(state: "Status") -> Moment:
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


@contextmanager
def _view() -> Iterator[Show]:
    """Draw on the whole terminal where that can be, else print a plain line a second."""
    is_drawn = can_draw(sys.stdout)
    if is_drawn and is_installed("top"):
        with _drawing() as show:
            yield show
        return
    if is_drawn:
        remark(f"this is text, as the packages that draw it are not installed\n  {line_to_install('top')}")
    from syncrelay.top.plain import line_of

    next_s = _LINE_S

    def show_line(moment: "Moment") -> None:
        nonlocal next_s
        if moment.elapsed_s >= next_s:
            print(line_of(moment), flush=True)  # noqa: T201  as it happens, through a pipe too
            next_s = math.floor(moment.elapsed_s) + _LINE_S

    print(_STARTING, flush=True)  # noqa: T201
    yield show_line


@contextmanager
def _drawing() -> Iterator[Show]:
    from rich.console import Console
    from rich.live import Live
    from rich.text import Text

    from syncrelay.logs import held_back
    from syncrelay.top.demo_screen import frame

    console = Console(highlight=False)
    with held_back(), Live(Text(_STARTING), console=console, screen=True, auto_refresh=False) as live:

        def draw(moment: "Moment") -> None:
            width, height = console.size
            live.update(frame(moment, width=width, height=height), refresh=True)

        yield draw


def record(name: str, seconds: float, seed: int) -> int:
    """Write what the rig sends in a time, without ROS; the same seed gives the same recording. Returns 0."""
    from heapq import merge
    from itertools import takewhile

    from syncrelay.cdr import patch_stamp
    from syncrelay.config.profile import Profile
    from syncrelay.recordings.bag.definitions import jazzy_definition
    from syncrelay.recordings.bag.mcap_output import McapOutput
    from syncrelay.rig.scene import SCENES
    from syncrelay.rig.schedule import SENSORS, schedule

    end = _START + round(seconds * _SECOND)

    def sent(name: str) -> Iterator[tuple[int, str, bytes]]:
        frames = SCENES[name][1]()
        for shot in takewhile(lambda shot: shot.sent < end, schedule(SENSORS[name], seed=seed, start=_START)):
            yield shot.sent + _ON_THE_WAY, name, patch_stamp(frames[shot.number % len(frames)], shot.stamp)

    counts = dict.fromkeys(SENSORS, 0)
    with McapOutput(name) as recording:
        outputs = {}
        for sensor_name, sensor in SENSORS.items():
            profile = Profile(depth=5, reliability="reliable" if sensor.reliable else "best_effort")
            type_name = SCENES[sensor_name][0]
            outputs[sensor_name] = recording.add(sensor.topic, type_name, *jazzy_definition(type_name), profile)
        for received, sensor_name, payload in merge(*map(sent, SENSORS)):
            recording.write(outputs[sensor_name], payload, received)
            counts[sensor_name] += 1
    put(f"{printable(name)}: {', '.join(f'{count} of {SENSORS[each].topic}' for each, count in counts.items())}")
    return DONE
