"""A test's stage: player, relay and collector, each a process, on a ROS domain of their own."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.ros import frames
from tests.ros.frames import Frame
from tests.ros.processes import DEADLINE_S, Process, ros_environment
from tests.ros.shared_memory import left_of

if TYPE_CHECKING:
    from tests.ros.caller import Caller

IS_COMPILED = find_spec("syncrelay.ros.compiled.path") is not None
"""Whether the compiled path was built here; tests/ros/test_compiled_build.py says where it must be."""
BACKEND = os.environ.get("SYNCRELAY_RECEIVE") or ("compiled" if IS_COMPILED else "rclpy")
"""What messages pass through where a test does not say."""
BACKENDS = tuple(dict.fromkeys([BACKEND, "rclpy"]))
both_backends = pytest.mark.parametrize("backend", BACKENDS)
"""For what must be so whichever backend messages pass through."""


# Of what fails in a sitecustomize, Python only warns.
_SITE = """\
import sys
if {word!r} in sys.orig_argv:
    try:
        exec(open({path!r}).read(), {{}})
    except Exception as error:
        sys.exit(repr(error))
"""


class Player:
    """Publishes frames; every call returns when it is done."""

    def __init__(self, process: Process, folder: Path) -> None:
        self.process = process
        self._folder = folder
        self._plays = 0

    def is_up(self) -> None:
        """Wait until its publishers are there."""
        self.process.ask("match 0")

    def match(self, subscriptions: int = 1) -> None:
        """Wait until every publisher has so many matched subscriptions at least."""
        self.process.ask(f"match {subscriptions}")

    def start(self, recording: Sequence[Frame], *, speed: float = 10) -> None:
        """Begin to play at a multiple of the recording's own pace; `finish` waits for the end."""
        self._start(recording, f"{speed}")
        self._span_s = (recording[-1].time - recording[0].time) / 1e9 / speed

    def start_by_clock(self, recording: Sequence[Frame]) -> None:
        """Play each frame at its time by the machine's clock; `finish` waits for the end."""
        self._start(recording, "clock")
        self._span_s = max(0.0, recording[-1].time / 1e9 - time.time())

    def _start(self, recording: Sequence[Frame], pace: str) -> None:
        self._plays += 1
        path = self._folder / f"{self.process.name}-{self._plays}.frames"
        frames.write(path, recording)
        self.process.tell(f"play {pace} {path}")

    def finished(self) -> bool:
        return self.process.stdout.count("play") == self._plays

    def finish(self) -> None:
        """Wait until all is published."""
        self.process.wait_until(self.finished, "the end of the recording", deadline_s=self._span_s + DEADLINE_S)
        self.process.answer()

    def stop(self) -> None:
        """Have it play no more."""
        self.process.tell("stop")
        self.finish()
        self.process.answer()

    def play(self, recording: Sequence[Frame], *, speed: float = 10) -> None:
        self.start(recording, speed=speed)
        self.finish()


class Collector:
    """Subscribes, keeps what it gets, and says what the graph shows."""

    def __init__(self, process: Process, output: Path) -> None:
        self.process = process
        self._output = output
        self._read = 0
        self._frames: list[Frame] = []

    def payloads(self, topic: str) -> list[bytes]:
        """All payloads of a topic so far, in the order of their arrival."""
        self._read_on()
        return [frame.payload for frame in self._frames if frame.topic == topic]

    def count(self, topic: str) -> int:
        return len(self.payloads(topic))

    def wait_for(self, topic: str, count: int) -> list[bytes]:
        """The payloads of a topic as soon as there are so many at least."""
        self.process.wait_until(lambda: self.count(topic) >= count, f"message {count} of {topic}")
        return self.payloads(topic)

    def endpoints(self, topic: str, *, kind: str, node: str | None = None) -> list[dict[str, str]]:
        """Publishers (`kind` publisher) or subscriptions of a topic, of one node if it is named."""
        listed = json.loads(self.process.ask(f"endpoints {topic}"))
        return [entry for entry in listed if entry["kind"] == kind and node in (None, entry["node"])]

    def nodes(self) -> list[str]:
        return list(json.loads(self.process.ask("nodes")))

    def _read_on(self) -> None:
        with self._output.open("rb") as file:
            file.seek(self._read)
            arrived, size = frames.parse(file.read())
        self._frames += arrived
        self._read += size


class Stage:
    """Starts the processes of one test on one domain."""

    def __init__(self, folder: Path, domain: int, backend: str = BACKEND) -> None:
        self.folder, self.domain = folder, domain
        self.environment = ros_environment(domain=domain, folder=folder)
        self.environment["SYNCRELAY_RECEIVE"] = backend
        self._processes: list[Process] = []
        self._segments: set[Path] = set()
        self._callers: list[Caller] = []

    def start(self, name: str, argv: Sequence[str], *, stdin: int = subprocess.DEVNULL) -> Process:
        process = Process(
            f"{name}-{len(self._processes)}", argv, environment=self.environment, folder=self.folder, stdin=stdin
        )
        self._processes.append(process)
        return process

    def relay(self, config: str, *arguments: str, before: Sequence[str] = ()) -> Process:
        """The relay on a file with this text; `before` are words to put before its command."""
        path = self.folder / f"config-{len(self._processes)}.yaml"
        path.write_text(config)
        words = [*before, sys.executable, "-m", "syncrelay", "--config", str(path), *arguments]
        return self.start("relay", words)

    def observe(self, config: str, *arguments: str) -> Process:
        """One that only observes, with a file with this text."""
        path = self.folder / f"config-{len(self._processes)}.yaml"
        path.write_text(config)
        return self.start("observe", [sys.executable, "-m", "syncrelay", "observe", "--config", str(path), *arguments])

    def player(
        self,
        topics: Mapping[str, str],
        *,
        node: str = "player",
        reliability: str = "reliable",
        durability: str = "volatile",
        before: Sequence[str] = (),
    ) -> Player:
        """A process that publishes on these topics, by name with their types; `before` are words before its command."""
        argv = _module("tests.ros.player", topics, node=node, reliability=reliability, durability=durability)
        return Player(self.start("player", [*before, *argv], stdin=subprocess.PIPE), self.folder)

    def collector(
        self,
        topics: Mapping[str, str] | None = None,
        *,
        node: str = "collector",
        reliability: str = "reliable",
        durability: str = "volatile",
        before: Sequence[str] = (),
    ) -> Collector:
        """A process that subscribes to these topics, by name with their types; `before` as with the player."""
        output = self.folder / f"collected-{len(self._processes)}.frames"
        output.touch()
        argv = _module("tests.ros.collector", topics or {}, node=node, reliability=reliability, durability=durability)
        return Collector(
            self.start("collector", [*before, *argv, "--output", str(output)], stdin=subprocess.PIPE), output
        )

    def caller(self, node: str = "/syncrelay") -> "Caller":
        """What calls services of a node."""
        from tests.ros.caller import Caller  # noqa: PLC0415  where ROS is not installed, nothing is called

        self._callers.append(Caller(node, domain=self.domain, environment=self.environment))
        return self._callers[-1]

    def before_each_sensor(self, statements: str) -> None:
        """Have each sensor of a rig that is started from now on run these statements before all else."""
        self._before("syncrelay.ros.sensor", statements)

    def before_each_relay(self, statements: str) -> None:
        """Have each relay that is started from now on run these statements before all else."""
        self._before("--config", statements)

    def _before(self, word: str, statements: str) -> None:
        """Have each process with this word in its command run these statements before all else."""
        folder = self.folder / "before"
        folder.mkdir()
        (folder / "statements.py").write_text(statements)
        (folder / "sitecustomize.py").write_text(_SITE.format(word=word, path=str(folder / "statements.py")))
        self.environment["PYTHONPATH"] += f":{folder}"

    def note_shared_memory(self) -> None:
        """Remember the segments that our processes have mapped: of the dead, nothing tells it."""
        for process in self._processes:
            self._segments |= process.shared_memory()

    def left_in_shared_memory(self) -> set[Path]:
        return left_of(self.domain, self._segments)

    def end(self) -> None:
        """End all processes and remove what they left, as Fast DDS does after SIGKILL."""
        self.note_shared_memory()
        for caller in self._callers:
            caller.close()
        for process in self._processes:
            process.ask_to_end()
        for process in self._processes:
            process.reap()
            # pytest shows it beside a failure.
            print(f"--- {process.name}\n{process.stderr}")  # noqa: T201
        for path in self.left_in_shared_memory():
            path.unlink(missing_ok=True)


@contextmanager
def running_stage(folder: Path, domain: int, backend: str = BACKEND) -> Iterator[Stage]:
    stage = Stage(folder, domain, backend)
    try:
        yield stage
    finally:
        stage.end()


def _module(name: str, topics: Mapping[str, str], *, node: str, reliability: str, durability: str) -> list[str]:
    chosen = [word for topic, type_name in topics.items() for word in ("--topic", topic, type_name)]
    return [
        sys.executable,
        "-m",
        name,
        *chosen,
        f"--node={node}",
        f"--reliability={reliability}",
        f"--durability={durability}",
    ]
