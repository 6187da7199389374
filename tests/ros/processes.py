"""Processes started by a test: waited on by conditions, ended by their ids, and nothing of them left."""

import contextlib
import os
import signal
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from tests import preloaded
from tests.ros.shared_memory import segments_of

# What is still missing after this long will not come. A bound for broken runs, not a measure: on an idle
# machine everything waited for here takes a second or two.
DEADLINE_S = 150.0
_REAPED_S = 30.0
_POLL_S = 0.02
_ROS_PREFIXES = ("ROS_", "RMW_", "RCL_", "RCUTILS_", "FASTDDS_", "FASTRTPS_", "SYNCRELAY_")
# Which ROS is sourced, not how it behaves.
_ROS_IDENTITY = {"ROS_DISTRO", "ROS_VERSION", "ROS_PYTHON_VERSION"}


def wait_until(
    condition: Callable[..., object], what: str, *, deadline_s: float = DEADLINE_S, poll_s: float = _POLL_S
) -> None:
    """Return as soon as the condition holds; `what` says in an AssertionError what did not come.

    The condition is called with nothing. It may be a lambda that keeps what a loop has come to as a default.
    """
    end = time.monotonic() + deadline_s
    while not condition():
        if time.monotonic() > end:
            raise AssertionError(f"waited {deadline_s:.0f} s in vain for {what}")
        time.sleep(poll_s)


def ros_environment(*, domain: int, folder: Path) -> dict[str, str]:
    """The caller's environment without any choice of ROS that it made, on a domain of its own."""
    kept = {
        name: value for name, value in os.environ.items() if name in _ROS_IDENTITY or not name.startswith(_ROS_PREFIXES)
    }
    return kept | {
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_LOG_DIR": str(folder / "ros-log"),
        **preloaded.PYTHON,
        "NO_COLOR": "1",
    }


def ours_of(stderr: str) -> list[str]:
    """The lines of stderr but those of Fast DDS, which complains there of what others do to its shared memory."""
    return [line for line in stderr.splitlines() if "RTPS_" not in line]


def children_of(pid: int) -> list[int]:
    """The ids of the processes that a process has started; none if it is gone."""
    try:
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return []
    return [int(child) for child in children.split()]


def is_alive(pid: int) -> bool:
    """Whether a process runs: one that ended is none, though nobody may have asked for its exit code yet."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except (FileNotFoundError, ProcessLookupError):
        return False


class Process:
    """A started process whose stdout and stderr go to files.

    With `stdin=subprocess.PIPE` it can be asked things, and ends when its stdin does; without, at SIGTERM.
    """

    def __init__(
        self,
        name: str,
        argv: Sequence[str],
        *,
        environment: Mapping[str, str],
        folder: Path,
        stdin: int = subprocess.DEVNULL,
    ) -> None:
        self.name = name
        self._stdout, self._stderr = folder / f"{name}.stdout", folder / f"{name}.stderr"
        with self._stdout.open("wb") as stdout, self._stderr.open("wb") as stderr:
            self._child = preloaded.start(argv, stdin=stdin, stdout=stdout, stderr=stderr, env=environment, cwd=folder)
        self._answered = 0
        self._left: set[Path] = set()

    @property
    def pid(self) -> int:
        return self._child.pid

    @property
    def stdout(self) -> str:
        return self._stdout.read_text()

    @property
    def stderr(self) -> str:
        return self._stderr.read_text()

    @property
    def said(self) -> list[str]:
        return ours_of(self.stderr)

    def running(self) -> bool:
        return self._child.poll() is None

    def wait_until(self, condition: Callable[..., object], what: str, *, deadline_s: float = DEADLINE_S) -> None:
        """As the function of that name, but over at once when the process ends."""
        held = False

        def over() -> bool:
            nonlocal held
            ended = not self.running()
            held = bool(condition())
            return held or ended

        try:
            wait_until(over, what, deadline_s=deadline_s)
        except AssertionError as error:
            raise AssertionError(f"{error}\n{self._said()}") from None
        if not held:
            raise AssertionError(f"{self.name} ended with {self._child.poll()} before {what}\n{self._said()}")

    def wait_for_log(self, text: str) -> None:
        self.wait_until(lambda: text in self.stderr, f"{text!r} on the stderr of {self.name}")

    def ask(self, command: str) -> str:
        """Write a command line to stdin; the line of stdout that answers it."""
        self.tell(command)
        return self.answer()

    def tell(self, command: str) -> None:
        assert self._child.stdin is not None
        self._child.stdin.write(f"{command}\n".encode())
        self._child.stdin.flush()

    def answer(self) -> str:
        """The next line of stdout, in the order of the commands."""
        self.wait_until(lambda: self.stdout.count("\n") > self._answered, f"{self.name}'s answer")
        self._answered += 1
        return self.stdout.splitlines()[self._answered - 1]

    def send(self, number: signal.Signals) -> None:
        # At SIGKILL, and at a second SIGTERM, it removes nothing; and of the dead nothing tells what was theirs.
        self._left = self.shared_memory()
        self._child.send_signal(number)

    def wait(self, timeout_s: float = DEADLINE_S) -> int:
        """The exit code; raises subprocess.TimeoutExpired."""
        return self._child.wait(timeout_s)

    def ask_to_end(self) -> None:
        if self._child.stdin is None:
            self._child.terminate()
            return
        with contextlib.suppress(BrokenPipeError):
            self._child.stdin.close()

    def reap(self) -> None:
        """Wait for its end, at last with SIGKILL."""
        for insist in (self._child.terminate, self._child.kill):
            try:
                # What is killed leaves shared memory, and what is told twice to end, too.
                self._child.wait(_REAPED_S)
            except subprocess.TimeoutExpired:
                insist()
        self._child.wait()

    def handles(self, number: signal.Signals) -> bool:
        """Whether the process has a handler of its own for a signal, as the kernel says."""
        status = Path(f"/proc/{self.pid}/status").read_text()
        mask = next(line.split()[1] for line in status.splitlines() if line.startswith("SigCgt:"))
        return bool(int(mask, 16) >> (number - 1) & 1)

    def shared_memory(self) -> set[Path]:
        """The segments of Fast DDS that it and its children have mapped, or had when it was killed."""
        return self._left.union(*map(segments_of, [self.pid, *children_of(self.pid)]))

    def _said(self) -> str:
        tail = self.stderr.splitlines()[-30:]
        return "\n".join([f"--- the last of {self.name}'s stderr", *tail])
