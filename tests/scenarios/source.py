"""A process that plays streams in real time. Run as `python -m tests.scenarios.source FILE`; see streams.py.

Each line of stdin is the number of an act, which begins at once. It ends when stdin does.
"""

import heapq
import os
import select
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import rclpy
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from tests.ros.cdr_messages import vector
from tests.ros.message_types import import_type
from tests.scenarios.streams import Sampler, Stream, from_json

if TYPE_CHECKING:
    from rclpy.node import Node

_LONGEST_SLEEP_S = 0.1
# A driver that did not get the CPU for so long has lost the sample: it does not send it late.
_LOST_S = 0.1
# One that did not get it for so long says so.
_STALLED_S = 0.25


class _Graph:
    """The nodes and publishers that there are."""

    def __init__(self) -> None:
        self._nodes: dict[str, Node] = {}
        self._publishers: dict[tuple[str, ...], Publisher] = {}

    def change(self, streams: Sequence[Stream]) -> None:
        """Let there be the publishers of these streams and no other."""
        wanted = {stream.publisher: stream for stream in streams}
        for key in self._publishers.keys() - wanted.keys():
            self._nodes[key[0]].destroy_publisher(self._publishers.pop(key))
        for name in self._nodes.keys() - {stream.driver for stream in streams}:
            self._nodes.pop(name).destroy_node()
        for key in wanted.keys() - self._publishers.keys():
            self._publishers[key] = self._publisher(wanted[key])

    def publisher(self, stream: Stream) -> Publisher:
        return self._publishers[stream.publisher]

    def _publisher(self, stream: Stream) -> Publisher:
        profile = QoSProfile(
            depth=100,
            reliability=ReliabilityPolicy[stream.reliability.upper()],
            durability=DurabilityPolicy[stream.durability.upper()],
        )
        if stream.driver not in self._nodes:
            namespace, _, name = stream.driver.rpartition("/")
            self._nodes[stream.driver] = rclpy.create_node(
                name, namespace=namespace, start_parameter_services=False, enable_rosout=False
            )
        return self._nodes[stream.driver].create_publisher(import_type(stream.type), stream.topic, profile)


class _Source:
    def __init__(self, streams: Sequence[Stream]) -> None:
        self._streams = streams
        self._graph = _Graph()
        self._samplers: dict[Stream, Sampler] = {}
        self._due: list[tuple[float, float, int, Stream, float]] = []
        self._count = 0
        self._began = 0.0
        self._clocks: dict[str, int] = {}

    def begin(self, act: str) -> None:
        active = [stream for stream in self._streams if act in stream.acts]
        self._graph.change(active)
        if not self._clocks:
            self._began = time.monotonic()
            self._clocks = {"wall": time.time_ns(), "boot": time.monotonic_ns()}
            now = 0.0
        else:
            now = time.monotonic() - self._began
        ended = self._samplers.keys() - set(active)
        self._due = [entry for entry in self._due if entry[3] not in ended]
        heapq.heapify(self._due)
        kept = {stream: sampler for stream, sampler in self._samplers.items() if stream not in ended}
        self._samplers = {stream: kept.get(stream) or Sampler(stream, now=now) for stream in active if stream.hz}
        for stream in self._samplers.keys() - kept.keys():
            self._push(stream)

    def send_what_is_due(self) -> float:
        """Publish it; for how many seconds there is nothing more to do."""
        while self._due:
            left = self._began + self._due[0][0] - time.monotonic()
            if left > 0:
                return min(left, _LONGEST_SLEEP_S)
            *_, stream, stamp = heapq.heappop(self._due)
            self._push(stream)
            if left < -_LOST_S:
                continue
            ns = self._clocks.get(stream.clock, 0) + round(stamp * 1e9)
            message = vector(0 if stream.clock == "zero" else ns)
            self._graph.publisher(stream).publish(message[:8] if stream.clock == "none" else message)
        return _LONGEST_SLEEP_S

    def _push(self, stream: Stream) -> None:
        self._count += 1
        send, sampled, stamp = self._samplers[stream].next()
        heapq.heappush(self._due, (send, sampled, self._count, stream, stamp))


def main() -> None:
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    source = _Source(from_json(Path(sys.argv[1]).read_text()))
    # Without a buffer, which would hold the next line where select sees nothing.
    stdin = os.fdopen(sys.stdin.fileno(), "rb", buffering=0, closefd=False)
    pause, turned = 0.0, time.monotonic()
    while True:
        is_told = bool(select.select([stdin], [], [], pause)[0])
        if (late := time.monotonic() - turned - pause) > _STALLED_S:
            print(f"stalled for {late:.2f} s", flush=True)  # noqa: T201  whoever judges what came looks for it
        if is_told:
            line = stdin.readline()
            if not line:
                break
            source.begin(line.decode().strip())
        pause = source.send_what_is_due()
        turned = time.monotonic()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
