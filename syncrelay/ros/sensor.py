"""One sensor of the rig as a process: `python -m syncrelay.ros.sensor camera --seed 1`."""

import argparse
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator, Sequence

from syncrelay.cdr import patch_stamp
from syncrelay.environment.domain import ports_of
from syncrelay.fastdds_files import held_by, ports_among, remove_unused
from syncrelay.rig.processes import LEAVE_WITHIN_S, UP
from syncrelay.rig.schedule import SENSORS, Shot, schedule
from syncrelay.ros.environment import log_arguments
from syncrelay.wakeup import Wakeup


def main(arguments: Sequence[str]) -> int:
    """Publish until SIGINT, SIGTERM or, where asked, the end of stdin; return the exit code."""
    stop = Wakeup()
    # Before rclpy is imported: a signal that came during the import would be lost.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    options = _parser().parse_args(arguments)
    if options.until_stdin_ends:
        threading.Thread(target=_stop_at_end_of_stdin, args=(stop,), daemon=True).start()
    start = time.time_ns() if options.start is None else options.start
    _publish(options.sensor, schedule(SENSORS[options.sensor], seed=options.seed, start=start), stop)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m syncrelay.ros.sensor", description=__doc__)
    parser.add_argument("sensor", choices=tuple(SENSORS))
    parser.add_argument("--seed", type=int, default=0, help="of jitter, latency and losses (default: 0)")
    parser.add_argument("--start", type=int, help="begin of the schedule, in nanoseconds (default: now)")
    parser.add_argument("--until-stdin-ends", action="store_true", help="end with whoever holds stdin's pipe")
    return parser


def _stop_at_end_of_stdin(stop: Wakeup) -> None:
    # Not sys.stdin: a daemon thread that holds its lock would abort the interpreter's exit.
    while os.read(0, 4096):
        pass
    # Where a process was killed, DDS may wait forever for what that held. The kernel needs no turn of ours to end it.
    signal.alarm(LEAVE_WITHIN_S)
    stop.set()


def _publish(name: str, shots: Iterator[Shot], stop: Wakeup) -> None:
    """Send each message at its time; those due before the publisher was up are not made up for."""
    import rclpy  # noqa: PLC0415 - signals are handled before this
    from rclpy.qos import QoSProfile, ReliabilityPolicy  # noqa: PLC0415
    from rclpy.signals import SignalHandlerOptions  # noqa: PLC0415

    from syncrelay.relay.types import import_type  # noqa: PLC0415
    from syncrelay.rig.scene import SCENES  # noqa: PLC0415
    from syncrelay.ros.leaving import is_leaving, leave  # noqa: PLC0415

    sensor, (type_name, make_frames) = SENSORS[name], SCENES[name]
    frames = make_frames()
    reliability = ReliabilityPolicy.RELIABLE if sensor.reliable else ReliabilityPolicy.BEST_EFFORT
    rclpy.init(args=["--ros-args", *log_arguments()], signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node(name, namespace="/demo", start_parameter_services=False, enable_rosout=False)
    publisher = node.create_publisher(
        import_type(type_name), sensor.topic, QoSProfile(depth=5, reliability=reliability)
    )
    print(UP, sensor.topic, flush=True)  # noqa: T201  whoever started it waits for this
    up = time.time_ns()
    for shot in shots:
        if shot.sent < up:
            continue
        if stop.wait(max(0, shot.sent - time.time_ns()) / 1e9):
            break
        publisher.publish(patch_stamp(frames[shot.number % len(frames)], shot.stamp))
    context = rclpy.utilities.get_default_context()
    held, ports = held_by(os.getpid()), ports_of(context.get_domain_id())
    leave(node, context)
    if is_leaving():
        os._exit(0)
    # Of processes that leave a port at the same moment, Fast DDS may let the last one leave the file: it may be one
    # that we took after we noted what we held, and that was in use as others looked.
    remove_unused(held | ports_among(ports))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
