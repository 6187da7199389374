"""A world: sensors, a relay and who listens to it, in virtual time, and all that happens to them."""

import json
import struct
from collections import defaultdict
from collections.abc import Callable, Sequence
from functools import partial
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from syncrelay.config import Config
from syncrelay.config.profile import Profile
from tests.ros.transforms import TF, transforms
from tests.simulated.bus import Bus, Reader, Weather, Writer
from tests.simulated.node import CLOCK_TYPE, SimulatedBackend, SimulatedNode
from tests.simulated.plan import TYPE, Plan, Sensor
from tests.simulated.running import Running
from tests.simulated.scheduler import MS, SECOND, Process, Scheduler, SimulatedRuntime

if TYPE_CHECKING:
    from random import Random

OTHER_TYPE: Final = "geometry_msgs/msg/PointStamped"
_TICK: Final = 100 * MS
_FILES: Final = "syncrelay-files"
# Calls after which a relay that is paused or inactive is so still.
_SENDS_NOTHING_NEW: Final = frozenset({"status", "reload", "pause", "deactivate"})
# Moments begin here, some time before the world does.
_FIRST: Final = 900 * SECOND


_NEVER: Final = 1 << 62


class _Span(NamedTuple):
    """How far the rig's clock is ahead of the monotonic one from a time on, and when it came to rest."""

    since: int
    offset: int
    until: int = _NEVER


class Line(NamedTuple):
    """A line of the relay's log."""

    at: float
    level: int
    text: str


_STAMP: Final = struct.Struct("<iII")
_VECTOR: Final = struct.Struct("<3d")


def content(stamp: int, frame: str, sensor: int, number: int) -> bytes:
    """A Vector3Stamped that tells which message it is."""
    seconds, nanoseconds = divmod(stamp, SECOND)
    text = frame.encode() + b"\0"
    head = _STAMP.pack(seconds, nanoseconds, len(text)) + text
    return b"\0\1\0\0" + head + bytes(-len(head) % 8) + _VECTOR.pack(sensor, number, -1.5)


def identity(payload: bytes) -> tuple[int, int]:
    """Which sensor's message this is, and which of its."""
    sensor, number, _ = _VECTOR.unpack(payload[-24:])
    return int(sensor), int(number)


class Driver:
    """A sensor's driver: a process of its own, which may be started again."""

    def __init__(self, world: "World", sensor: Sensor, index: int) -> None:
        self.world, self.sensor, self.index = world, sensor, index
        self.period = round(SECOND / world.plan.hz) // sensor.every
        self.random = world.scheduler.stream(f"driver {index}")
        self.is_silent = self.is_twice = self.is_cut = self.is_zero = self.is_halved = self.is_doubled = False
        self.shift = 0
        self.batch = 0
        self.type, self.reliability = TYPE, sensor.reliability
        self.usual = dict(vars(self))
        self.dies_in_write = False
        self._life = 0
        self._number = 0
        self.writer: Writer | None = None
        self.lives: list[tuple[float, float]] = []
        """When it was there with messages of the usual type, in seconds since the world began."""
        self.died: float | None = None

    def start(self) -> None:
        """Join, and publish from the next moment on."""
        self.leave()
        self._life += 1
        process = Process(self.world.scheduler, f"driver of {self.sensor.topic}")
        process.clock_offset = self.world.clock_offset
        self.process = process
        self.participant = self.world.bus.participant(process)
        node = self.participant.node(f"driver{self.index}")
        sensor = self.sensor
        profile = Profile(depth=sensor.depth, reliability=self.reliability, durability=sensor.durability)
        self.writer = node.writer(sensor.topic, self.type, profile)
        now = self.world.scheduler.now
        self.lives.append((self.world.now, inf))
        self._number = max(self._number, (now - _FIRST) // self.period + 1)
        self._plan_next(self._life)

    def leave(self) -> None:
        """Leave in order."""
        if self.writer is not None:
            self.writer = None
            self._end_life()
            self.participant.leave()

    def _end_life(self) -> None:
        self.lives[-1] = self.lives[-1][0], self.world.now

    def die(self) -> None:
        """Die, as by SIGKILL."""
        if self.writer is not None:
            self.writer = None
            self.died = self.world.now
            self._end_life()
            self.participant.kill()

    def sampled_at(self, number: int) -> int:
        """When a message is sampled, in monotonic time."""
        return _FIRST + number * self.period

    def _plan_next(self, life: int) -> None:
        scheduler = self.world.scheduler
        at = self.sampled_at(self._number)
        due = at + self.sensor.takes
        if self.batch:
            due = -(-due // self.batch) * self.batch
        scheduler.at(max(due, scheduler.now), lambda: self._publish(at, life))

    def _publish(self, at: int, life: int) -> None:
        if self.writer is None or life != self._life:
            return
        number = self._number
        self._number += 1
        self._plan_next(life)
        if self.is_silent or (self.is_halved and number % 2) or self.world.rested_at(at):
            return
        # What is under way as the rig's clock jumps was sampled before.
        stamp = self.world.stamp_at(at)
        if self.sensor.wobble:
            stamp += int(self.sensor.wobble * self.random.random())
        stamp = 0 if self.is_zero else max(0, stamp + self.shift)
        data = content(stamp, self._frame(f"{number}/{self.sensor.every}"), self.index, number)
        if self.is_cut:
            data = data[:6]
        if self.dies_in_write:
            self.dies_in_write = False
            writer, self.writer = self.writer, None
            self.died = self.world.now
            self._end_life()
            writer.write(data, dies=True)
            return
        self.world.heard_write(self.sensor.topic, number)
        self.writer.write(data)
        if self.is_twice:
            self.writer.write(data)
        if self.is_doubled:
            self.world.scheduler.after(self.period // 2, partial(self._write_between, stamp, life))

    def _write_between(self, stamp: int, life: int) -> None:
        """Write a message of no moment of the rig."""
        if self.writer is not None and life == self._life:
            self.writer.write(content(stamp + self.period // 2, self._frame("between"), self.index, -1))

    def _frame(self, key: str) -> str:
        """Return the frame of a message: where sets wait for transforms, the sensor's; else what it is matched by."""
        return f"s{self.index}" if self.world.plan.transforms else key


class Broadcaster:
    """Somebody who publishes transforms: where the sensors are on the robot, and at 5 Hz where that is."""

    def __init__(self, world: "World") -> None:
        self.world = world
        self.is_silent = False

    def start(self) -> None:
        process = Process(self.world.scheduler, "broadcaster")
        process.clock_offset = self.world.clock_offset
        node = self.world.bus.participant(process).node("broadcaster")
        static = node.writer("/tf_static", TF, Profile(depth=1, durability="transient_local"))
        edges = [("base", f"s{index}", 0) for index in range(len(self.world.plan.sensors))]
        static.write(transforms("/tf_static", *edges).payload)
        self.writer = node.writer("/tf", TF, Profile(depth=100))
        # Serialized once: the stamp stands behind the encapsulation and the number of transforms.
        self._message = transforms("/tf", ("odom", "base", 1)).payload
        self._publish()

    def _publish(self) -> None:
        scheduler = self.world.scheduler
        scheduler.after(200 * MS, self._publish)
        if not self.is_silent:
            stamp = max(1, self.world.stamp_at(scheduler.now - 10 * MS))
            self.writer.write(self._message[:8] + struct.pack("<iI", *divmod(stamp, SECOND)) + self._message[16:])


class Witness:
    """Somebody who subscribes to all outputs."""

    def __init__(self, world: "World", topics: Sequence[str]) -> None:
        self.world, self.topics = world, topics
        self.readers: list[Reader] = []
        self.away_since: float | None = 0.0

    def start(self) -> None:
        self.leave()
        self.away_since = None
        process = Process(self.world.scheduler, "witness")
        self.participant = self.world.bus.participant(process)
        node = self.participant.node("witness")
        profile = Profile(reliability="best_effort", depth=100)
        self.readers = [node.reader(topic, TYPE, profile) for topic in self.topics]
        for reader in self.readers:
            reader.is_sink = True

    def leave(self) -> None:
        if self.readers:
            self.readers = []
            self.away_since = self.world.now
            self.participant.leave()


class RelayProcess(Running):
    """The relay, in a process of its own."""

    def __init__(self, world: "World", path: Path) -> None:
        self.process = Process(world.scheduler, "relay")
        self.process.clock_offset = world.clock_offset
        self.node: SimulatedNode | None = None
        self.left: list[str] = []
        """What it had not freed when it had ended, and threads that had not. A file that is read is not waited for."""
        self._world, self._simulated = world, SimulatedRuntime(self.process)
        super().__init__(
            path,
            join=self._joined,
            runtime=self._simulated,
            watched=world.plan.watched,
            drained=lambda: world.drained(),  # noqa: PLW0108  it may be another then
        )
        world.scheduler.start("main", self.main, self.process)

    def main(self) -> None:
        super().main()
        self.left = [*(name for name in self._simulated.alive() if name != _FILES), *self._simulated.held]

    def _joined(self, config: Config) -> tuple[SimulatedNode, SimulatedBackend]:
        participant = self._world.bus.participant(self.process)
        self.node = SimulatedNode(participant, self._simulated, is_simulated=config.node.use_sim_time)
        self.node.refusal = self._world.refused
        return self.node, SimulatedBackend(self._simulated)


class World:
    """All of it, as a plan has it."""

    def __init__(self, plan: Plan, folder: Path) -> None:
        self.plan = plan
        self.scheduler = Scheduler(plan.seed, eagerness=plan.eagerness, lag_ns=round(plan.lag_ms * MS))
        self.began = self.scheduler.now
        self.clock_offset = self.scheduler.process.clock_offset
        self._rig_clock = [_Span(0, -self.began if plan.by_sim_time else self.clock_offset)]
        self.still_since: float | None = None
        """Since when the relay must send nothing: it has said that it is paused, or deactivated."""
        self.random: Random = self.scheduler.stream("world")
        weather = Weather(
            discovery=round(plan.discovery_ms * MS), latency=round(plan.latency_ms * MS), missed=plan.missed
        )
        self.bus = Bus(self.scheduler, weather)
        self.bus.arrived = self._on_arrival
        self._upon_arrival: list[Callable[[], object]] = []
        self.outputs = {
            f"/{group.name}{topic}": (group.name, index)
            for group in plan.groups
            for index, topic in enumerate(group.topics)
        }
        self.refusal: str | None = None
        """Why DDS makes nothing on the outputs."""
        self.refused_everywhere: str | None = None
        """Why it makes nothing at all."""
        self.refused_output: str | None = None
        """The one output on which it makes nothing."""
        self.refusals: dict[str, list[float]] = defaultdict(list)
        self.reloads_again = False
        """Whether the file was read while DDS made not all, and is to be read again once it does."""
        self.path = folder / "fusion.yaml"
        self.absent: set[str] = set()
        self.is_to_be_active = False
        self.changed: dict[str, int] = {}
        self.drivers = {each.topic: Driver(self, each, index) for index, each in enumerate(plan.sensors)}
        self.broadcaster = Broadcaster(self)
        self.witness = Witness(self, list(self.outputs))
        self.answers: list[tuple[float, str, Any]] = []
        self.lines: list[Line] = []
        self.heard_write: Callable[[str, int], object] = lambda *_: None
        self.drained: Callable[[], object] = lambda: None
        self.write_file()
        self.relay: RelayProcess | None = None

    def refused(self, topic: str) -> str | None:
        """Return why DDS makes nothing on a topic for the relay."""
        one = "no memory" if topic == self.refused_output else None
        why = one or self.refused_everywhere or (self.refusal if topic in self.outputs else None)
        if why is not None:
            self.refusals[topic].append(self.now)
        return why

    @property
    def now(self) -> float:
        """Seconds since the begin."""
        return (self.scheduler.now - self.began) / SECOND

    def stamp_at(self, when: int) -> int:
        """What the rig's clock shows at a monotonic time."""
        now = self._span_of(when)
        return min(when, now.until) + now.offset

    def rested_at(self, when: int) -> bool:
        """Whether that clock stood still: nothing was sampled then."""
        return when > self._span_of(when).until

    def _span_of(self, when: int) -> _Span:
        last = self._rig_clock[-1]
        if last.since <= when:
            return last
        return next(each for each in reversed(self._rig_clock) if each.since <= when)

    def shift_rig_clock(self, by: int) -> None:
        """Set the clock that stamps all messages."""
        last = self._rig_clock[-1]
        self._rig_clock.append(_Span(self.scheduler.now, last.offset + by, last.until))

    def stop_rig_clock(self) -> None:
        """Have it rest."""
        last = self._rig_clock[-1]
        self._rig_clock[-1] = last._replace(until=min(last.until, self.scheduler.now))

    def go_on_with_rig_clock(self) -> None:
        """Have it go on where it rested."""
        now, last = self.scheduler.now, self._rig_clock[-1]
        if last.until < _NEVER:
            self._rig_clock.append(_Span(now, last.offset + last.until - now))

    def upon_arrival(self, event: Callable[[], object]) -> None:
        """Have an event happen as the next message has arrived at the relay, or in a second if none does."""
        waiting = self._upon_arrival
        waiting.append(event)

        def wait_no_longer() -> None:
            if event in waiting:
                waiting.remove(event)
                event()

        self.scheduler.after(SECOND, wait_no_longer)

    def _on_arrival(self, reader: Reader) -> None:
        while self._upon_arrival and self.relay is not None and reader.participant.process is self.relay.process:
            self._upon_arrival.pop(0)()

    def write_file(self, text: str | None = None) -> None:
        """Write the relay's file as it is to be now, or a text."""
        self.path.write_text(self.file() if text is None else text)

    def file(self) -> str:
        """Return the relay's file as it is to be now."""
        groups = {
            each.name: each.in_file(slop_factor=1 + self.changed.get(each.name, 0))
            for each in self.plan.groups
            if each.name not in self.absent
        }
        return json.dumps({"version": 1, "node": dict(self.plan.node), "metrics": None, "groups": groups})

    def start(self) -> None:
        """Have all of it begin, each at a time of its own."""
        chance = self.random
        for driver in self.drivers.values():
            self.scheduler.after(int(chance.uniform(0, 3) * SECOND), driver.start)
        self.scheduler.after(int(chance.uniform(0, 3) * SECOND), self.witness.start)
        if self.plan.transforms:
            self.broadcaster.start()
        if self.plan.by_sim_time:
            self._start_clock()
        self.scheduler.after(int(chance.uniform(0, 3) * SECOND), self._start_relay)

    def _start_relay(self) -> None:
        # With a faulty file it would not start.
        self.write_file()
        self.relay = RelayProcess(self, self.path)
        if self.plan.is_managed:
            self.scheduler.after(2 * SECOND, self.bring_up)

    def _start_clock(self) -> None:
        process = Process(self.scheduler, "clock")
        node = self.bus.participant(process).node("simulator")
        writer = node.writer("/clock", CLOCK_TYPE, Profile(depth=1, reliability="best_effort"))

        def tick() -> None:
            self.scheduler.after(_TICK, tick)
            if not self.rested_at(self.scheduler.now):
                seconds, nanoseconds = divmod(max(0, self.stamp_at(self.scheduler.now)), SECOND)
                writer.write(b"\0\1\0\0" + struct.pack("<iI", seconds, nanoseconds))

        tick()

    def ask(self, service: str) -> None:
        """Call a service of the relay."""
        node = self.relay.node if self.relay is not None else None
        if node is not None:
            if service == "resume":
                self.still_since = None
            asked = len(self.answers)
            self.answers.append((self.now, service, None))
            node.request(service, lambda answer: self._answered(asked, answer))

    def transit(self, name: str) -> None:
        """Ask the relay's node for a transition."""
        node = self.relay.node if self.relay is not None else None
        if node is not None:
            if name == "activate":
                self.still_since = None
            asked = len(self.answers)
            self.answers.append((self.now, name, None))
            node.transition(name, lambda success: self._answered(asked, success))

    def bring_up(self) -> None:
        """Have a managed node activated, as a lifecycle manager does: again and again until it is."""
        self.is_to_be_active = True
        self._manage()

    def _manage(self) -> None:
        node = self.relay.node if self.relay is not None else None
        if node is None or not self.is_to_be_active or node.state == "active":
            return
        self.transit("configure" if node.state == "unconfigured" else "activate")
        self.scheduler.after(2 * SECOND, self._manage)

    def _answered(self, asked: int, answer: Any) -> None:
        at, name, _ = self.answers[asked]
        self.answers[asked] = at, name, answer
        is_last = all(other in _SENDS_NOTHING_NEW for _, other, _ in self.answers[asked + 1 :])
        # A call that the end cuts short succeeds in nothing.
        if ((name == "pause" and answer.success) or (name == "deactivate" and answer is True)) and is_last:
            self.still_since = self.now

    def reload(self) -> None:
        """Have the relay read its file again, in one of the ways that there are."""
        if self.relay is None:
            return
        self.reloads_again = any((self.refusal, self.refused_everywhere, self.refused_output))
        if self.random.random() < 0.5:
            self.relay.hang_up()
        else:
            self.ask("reload")

    def reload_again(self) -> None:
        """Have the file read again, as somebody does whose reload was refused, if one may have been."""
        if self.reloads_again:
            self.reload()

    def set_clock(self, by: int) -> None:
        """Set this machine's clock."""
        self.clock_offset += by
        if not self.plan.by_sim_time:
            self.shift_rig_clock(by)
        for participant in self.bus.participants:
            participant.process.clock_offset += by
