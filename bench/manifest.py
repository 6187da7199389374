"""What a manifest costs: `python bench/manifest.py`. One relay, whose manifest is heard and not heard in turns.

CPU is what the relay's threads ran, by the scheduler's count, per message that it relayed; rounds of seconds are
interleaved and medians of their ratios given, so that what else runs matters less.
"""

import argparse
import os
import statistics
import sys
import tempfile
import time
from pathlib import Path

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from relay_runs import HERE, PATIENCE_S, Load, _started, environment, ours
from sensor_msgs.msg import Image, Imu

LOADS = {
    "2 x 200 Hz x 1 kB": Load("Image", 1_000, 200),
    "4 x 100 Hz Imu": Load("Imu", 0, 100, topics=4),
}
SETTLE_S = 0.4


def cpu_ns(pid):
    """What all threads of a process ran so far."""
    return sum(int(path.read_text().split()[0]) for path in Path(f"/proc/{pid}/task").glob("*/schedstat"))


class Listener:
    """Counts what leaves, and hears manifests or not."""

    def __init__(self, load):
        rclpy.init()
        self._node, self._type = rclpy.create_node("bench_listener"), {"Image": Image, "Imu": Imu}[load.type_name]
        self._output = self._node.create_subscription(self._type, load.outputs[0], print, 1, raw=True)
        self._manifest_type = DiagnosticArray

    def sets(self):
        """The number of the set that left last."""
        deadline = time.monotonic() + PATIENCE_S
        while (taken := self._output.handle.take_message(self._type, True)) is None:  # noqa: FBT003  rclpy's
            if time.monotonic() > deadline:
                raise RuntimeError("no more sets leave")
            time.sleep(0.002)
        return taken[1]["publication_sequence_number"]

    def hear(self):
        # DDS receives and acknowledges, whether anyone takes or not.
        return self._node.create_subscription(self._manifest_type, "/syncrelay/g0/sets", print, 500, raw=True)

    def end(self, subscription):
        self._node.destroy_subscription(subscription)


def cost_of(pid, listener, topics, seconds):
    """CPU per relayed message over some seconds, in ns."""
    time.sleep(SETTLE_S)
    sets, cpu = listener.sets(), cpu_ns(pid)
    time.sleep(seconds)
    return (cpu_ns(pid) - cpu) / ((listener.sets() - sets) * topics)


def measure(load, rounds, seconds, folder):
    environ = environment({"ROS_LOG_DIR": str(folder)})
    os.environ.update(environ)
    children = []
    rig, counted = [sys.executable, str(HERE / "rig.py"), "publish", load.type_name], int(1e9)
    pace = [f"--size={load.size}", f"--rate={load.rate}", "--warm-up=1", f"--counted={counted}"]
    with (folder / "log").open("w+") as log:
        try:
            relay = _started(children, ours(load, folder), environ, log)
            publisher = _started(children, [*rig, *pace, f"--together={load.topics}", *load.inputs], environ, log)
            publisher.read()
            listener = Listener(load)
            publisher.tell("go")
            time.sleep(5)
            pairs = []
            for _ in range(rounds):
                alone = cost_of(relay.process.pid, listener, load.topics, seconds)
                subscription = listener.hear()
                heard = cost_of(relay.process.pid, listener, load.topics, seconds)
                listener.end(subscription)
                pairs.append((alone, heard))
            return pairs
        finally:
            children[0].process.terminate()
            for child in children:
                child.process.terminate()
                child.end()


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=15, help="(default: %(default)s)")
    parser.add_argument("--seconds", type=float, default=2, help="of each half of a round (default: %(default)s)")
    parser.add_argument("load", nargs="?", choices=LOADS, default=next(iter(LOADS)))
    options = parser.parse_args()
    load = LOADS[options.load]
    with tempfile.TemporaryDirectory() as folder:
        pairs = measure(load, options.rounds, options.seconds, Path(folder))
    ratios = [heard / alone for alone, heard in pairs]
    alone, heard = (statistics.median(column) / 1000 for column in zip(*pairs, strict=True))
    print(f"{options.load}: CPU a message {alone:.0f} us, with its manifest heard {heard:.0f} us")
    print(f"ratio: median {statistics.median(ratios):.3f}, quartiles {statistics.quantiles(ratios)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
