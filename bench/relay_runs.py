"""One run of a relay between a publisher and a receiver, each a process, and what it cost."""

import json
import os
import select
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).parent
TICK_US = 1_000_000 / os.sysconf("SC_CLK_TCK")
# By then each of fifty groups has been looked at since the last publisher or subscriber came.
WARM_UP_S = 5.0
# Behind the last message; the C relay is asked for nothing more than the others.
SETTLE_S = 0.5
PATIENCE_S = 20.0


@dataclass(frozen=True)
class Load:
    """So many topics of a type, published at a rate, in groups that use them all."""

    type_name: str
    size: int
    rate: float
    topics: int = 2
    groups: int = 1
    shared: bool = False
    seconds: float = 5.0
    environ: Mapping[str, str] = field(default_factory=dict)

    @property
    def inputs(self):
        n_sources = 1 if self.shared else self.groups
        return [f"/in{number}" for number in range(self.topics * n_sources)]

    @property
    def outputs(self):
        return [f"/g{group}/out{index}" for group in range(self.groups) for index in range(self.topics)]

    @property
    def routes(self):
        """Input and output of each topic of each group."""
        inputs = self.inputs * (self.groups if self.shared else 1)
        return list(zip(inputs, self.outputs, strict=True))

    @property
    def counted(self):
        return max(1, round(self.rate * self.seconds))


class Figures(NamedTuple):
    """CPU of the relay per message that it had to relay, median age of what came back, the share that did not."""

    cpu_us: float
    latency_ms: float
    lost: float


class Start(NamedTuple):
    """Time and CPU until all is subscribed, and the share of a core that is used when nothing comes."""

    took_s: float
    cpu_s: float
    idle_share: float


Relay = Callable[[Load, Path], Sequence[str]]
"""From a load and a folder for files to the command of a relay for it."""


def ours(load, folder, **keys):
    path = folder / "relay.yaml"
    groups = {
        f"g{group}": {
            "policy": "approximate_time_eager",
            "slop": "5ms",
            "topics": [
                {"topic": topic, "type": f"sensor_msgs/msg/{load.type_name}", "output": output}
                for topic, output in load.routes[group * load.topics : (group + 1) * load.topics]
            ],
        }
        for group in range(load.groups)
    }
    path.write_text(json.dumps({"version": 1, **keys, "groups": groups}))
    return [sys.executable, "-m", "syncrelay", "--config", str(path)]


def ours_telling_all(load, folder):
    return ours(load, folder, diagnostics={"scalars": True})


def ours_telling_nothing(load, folder):
    *_, path = ours(load, folder, metrics=None, diagnostics=None)
    return [sys.executable, str(HERE / "untold.py"), path]


def ours_through_rclpy(load, folder):
    return ["env", "SYNCRELAY_RECEIVE=rclpy", *ours(load, folder)]


def typed(load, _folder):
    return [sys.executable, str(HERE / "typed_relay.py"), *_words(load)]


def _words(load):
    return [word for route in load.routes for word in (load.type_name, *route)]


# The wheels' libraries want symbols of the interpreter, so it calls the C program: one call, which ends with it.
CALL_MAIN = """
import ctypes, sys
words = [word.encode() for word in sys.argv[1:]]
sys.exit(ctypes.CDLL(sys.argv[1]).main(len(words), (ctypes.c_char_p * len(words))(*words)))
"""


def floor(folder):
    """The relay in C, compiled; None where there is no compiler, or no headers."""
    prefix = Path(sys.prefix)
    compiler = shutil.which("cc")
    if compiler is None or not (prefix / "include/rcl").is_dir():
        return None
    library = folder / "floor.so"
    includes = [f"-I{path}" for path in (prefix / "include").iterdir()]
    needed = ["rcl", "rmw", "rcutils", "rosidl_runtime_c", "sensor_msgs__rosidl_typesupport_c"]
    subprocess.run(
        [
            *(compiler, "-O2", "-Wall", "-shared", "-fPIC", "-o", str(library), str(HERE / "floor.c"), *includes),
            *(f"-L{prefix / 'lib'}", *(f"-l{name}" for name in needed)),
        ],
        check=True,
    )
    return lambda load, _folder: [sys.executable, "-c", CALL_MAIN, str(library), *_words(load)]


def cpu_us(pid):
    """User and system time of a process so far."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) * TICK_US


def environment(environ):
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("FASTDDS_", "FASTRTPS_"))}
    domain = str(1 + os.getpid() % 100)
    return kept | {"ROS_DOMAIN_ID": domain, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", **environ}


class Child:
    """A process that is talked to line by line, and ended."""

    def __init__(self, argv, environ, log):
        self.process = subprocess.Popen(
            argv, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log, env=environ, text=True
        )

    def read(self, patience_s=PATIENCE_S):
        ready, _, _ = select.select([self.process.stdout], [], [], patience_s)
        line = self.process.stdout.readline() if ready else ""
        if not line:
            raise RuntimeError(f"{self.process.args} said nothing")
        return line.rstrip("\n")

    def tell(self, line):
        self.process.stdin.write(f"{line}\n")
        self.process.stdin.flush()

    def end(self):
        """End it by the end of its stdin; if that does not help, by signals."""
        self.process.stdin.close()
        for insist in (self.process.terminate, self.process.kill):
            try:
                self.process.wait(2)
            except subprocess.TimeoutExpired:
                insist()
        self.process.wait()


def measure(relay, load):
    """Start a relay, load it, and return what it cost; raises RuntimeError where a process fails."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        environ = environment({**load.environ, "ROS_LOG_DIR": name})
        with (folder / "log").open("w+") as log:
            children = []
            try:
                return _measure(relay(load, folder), load, lambda argv: _started(children, argv, environ, log))
            except RuntimeError:
                sys.stderr.write((folder / "log").read_text())
                raise
            finally:
                if children:
                    children[0].process.terminate()
                for child in children:
                    child.end()


def _started(children, argv, environ, log):
    children.append(Child(argv, environ, log))
    return children[-1]


def _measure(command, load, start):
    rig = [sys.executable, str(HERE / "rig.py")]
    warm_up = max(1, round(load.rate * WARM_UP_S))
    pace = [f"--size={load.size}", f"--rate={load.rate}", f"--warm-up={warm_up}", f"--counted={load.counted}"]
    relay = start(command)
    publisher = start([*rig, "publish", load.type_name, *pace, f"--together={load.topics}", *load.inputs])
    receiver = start([*rig, "receive", load.type_name, f"--together={load.topics}", *load.outputs])
    for child in (publisher, receiver):
        child.read()
    # What matched on one side may still be unknown on the other.
    time.sleep(SETTLE_S)
    publisher.tell("go")
    publisher.read()
    before = cpu_us(relay.process.pid)
    span = publisher.read(load.seconds + PATIENCE_S)
    time.sleep(SETTLE_S)
    spent = cpu_us(relay.process.pid) - before
    receiver.tell(span)
    came, latency_ns = json.loads(receiver.read())
    due = load.counted * len(load.outputs)
    return Figures(spent / due, latency_ns / 1e6, 1 - came / due)


def start_and_idle(load, seconds):
    """Start a relay whose publishers are there, and leave it alone."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        environ = environment({"ROS_LOG_DIR": name})
        silent = ["--rate=1", "--together=1", "--size=0", "--warm-up=0", "--counted=0"]
        rig = [sys.executable, str(HERE / "rig.py"), "publish", load.type_name, *silent, *load.inputs]
        with (folder / "log").open("w+") as log:
            children = []
            try:
                publisher = _started(children, rig, environ, log)
                time.sleep(3)
                began = time.monotonic()
                relay = _started(children, ours(load, folder), environ, log)
                publisher.read()
                took_s, cpu_s = time.monotonic() - began, cpu_us(relay.process.pid) / 1e6
                time.sleep(5)
                before = cpu_us(relay.process.pid)
                time.sleep(seconds)
                return Start(took_s, cpu_s, (cpu_us(relay.process.pid) - before) / 1e6 / seconds)
            finally:
                for child in children:
                    child.end()


def interleaved(relays, load, runs):
    """Median figures of each relay, of runs in turns, so that what disturbs one disturbs all."""
    return in_turns({name: (relay, load) for name, relay in relays.items()}, runs)


def in_turns(measured, runs):
    """Median figures of each relay under its load, of runs in turns."""
    figures = {name: [] for name in measured}
    for _ in range(runs):
        for name, (relay, load) in measured.items():
            figures[name].append(measure(relay, load))
    return {
        name: Figures(*(statistics.median(column) for column in zip(*rows, strict=True)))
        for name, rows in figures.items()
    }
