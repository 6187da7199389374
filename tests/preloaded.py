"""Processes for tests, forked from a server that has imported what they need.

Importing rclpy, numpy and types of messages is more than half of the CPU that a process of a short test needs. What
is forked runs the same code, with an environment, a folder and standard streams of its own. What it lacks is the start
from the command line, which is the subject of the tests that use FROM_SCRATCH.

Run as `python -m tests.preloaded nodes FD`, with the file descriptor of a socket that listens, it is the server; it
ends when its stdin does.
"""

import atexit
import contextlib
import ctypes
import functools
import gc
import importlib
import json
import os
import pkgutil
import re
import selectors
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import warnings
from collections.abc import Iterator, Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import IO, Any, Final

import syncrelay
from syncrelay.config import ConfigError, load_text
from syncrelay.fastdds_files import held_by

FROM_SCRATCH: Final = ("env",)
"""Words before a command that make it a program of its own, started as a user starts it."""

# Where this syncrelay and these tests are imported from.
_PYTHON_PATH: Final = (Path(syncrelay.__file__).parents[1], Path(__file__).parents[1])
PYTHON: Final = {"PYTHONPATH": os.pathsep.join(map(str, _PYTHON_PATH)), "PYTHONSAFEPATH": "1"}
"""What the environment says of Python where nothing else is tested; with another, a process is no fork."""

# The modules that are forked when they are started by `python -m`, and the module that has the `main` of each.
_MAINS: Final = {
    "syncrelay": "syncrelay.cli",
    **{
        name: name
        for name in ("tests.faults.source", "tests.faults.witness", "tests.ros.collector", "tests.ros.player")
    },
}
# What nodes import while they run. A module that is not installed here is skipped.
_OF_NODES: Final = (
    "rclpy.executors",
    "syncrelay.cli.run",
    "syncrelay.explain.summary",
    "syncrelay.config",
    "syncrelay.logs",
    "syncrelay.ros.compiled.backend",
    "syncrelay.relay.running",
    "syncrelay.ros.joining",
    "syncrelay.ros.rclpy_backend",
    "syncrelay.status.server",
)
# Loading the first of them takes half of what a node needs to start.
_TYPE_SUPPORTS: Final = (
    "builtin_interfaces.msg",
    "diagnostic_msgs.msg",
    "geometry_msgs.msg",
    "rcl_interfaces.msg",
    "rcl_interfaces.srv",
    "rosgraph_msgs.msg",
    "sensor_msgs.msg",
    "std_msgs.msg",
    "std_srvs.srv",
    "type_description_interfaces.srv",
)
_ALMOST_A_FILE: Final = "{version: 1, groups: {g: {policy: exact_time, topics: [{topic: /a, type: a/msg/A}]}}}"
# Ray has threads of its own, and the other one runs a command.
_NEVER_IMPORTED: Final = ("on_ray", "__main__")
# Python and the dynamic loader read these at their start, so a fork cannot change them.
_GONE_BY_AT_THE_START: Final = ("AMENT_", "LANG", "LC_", "LD_", "PYTHON", "RMW_")
_LONGEST_REQUEST: Final = 1 << 20
# Several threads of a test may start the first process at once.
_STARTS: Final = threading.Lock()


class Forked:
    """A forked process, with those methods of subprocess.Popen that tests use."""

    def __init__(self, connection: socket.socket, *, stdin: int | None) -> None:
        self.pid = int(connection.recv(64))
        self.stdin = None if stdin is None else os.fdopen(stdin, "wb")
        self._connection = connection
        self._code: int | None = None

    def poll(self) -> int | None:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.wait(0)
        return self._code

    def wait(self, timeout: float | None = None) -> int:
        """The exit code, negative for a signal; raises subprocess.TimeoutExpired."""
        if self._code is None:
            self._connection.settimeout(timeout)
            try:
                self._code = int(self._connection.recv(64))
            except (BlockingIOError, TimeoutError):
                raise subprocess.TimeoutExpired(str(self.pid), timeout or 0) from None
            self._connection.close()
        return self._code

    def send_signal(self, number: signal.Signals) -> None:
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def terminate(self) -> None:
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


class Imported(StrEnum):
    """What a server has imported. At its end a fork changes, and so copies, most of that memory."""

    NODES = "nodes"
    COMMANDS = "commands"
    """All of syncrelay, too."""


def start(
    argv: Sequence[str],
    *,
    stdin: int,
    stdout: IO[Any],
    stderr: IO[Any],
    env: Mapping[str, str],
    cwd: Path,
    imported: Imported = Imported.NODES,
) -> "subprocess.Popen[bytes] | Forked":
    """Start a process; fork it if its command and environment allow that."""
    if not _is_forked(argv, env):
        return subprocess.Popen(argv, stdin=stdin, stdout=stdout, stderr=stderr, env=env, cwd=cwd)
    read, written = os.pipe() if stdin == subprocess.PIPE else (os.open(os.devnull, os.O_RDONLY), None)
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with _STARTS:
        address = _server(imported)
    connection.connect(address)
    request = json.dumps({"words": argv[2:], "environment": dict(env), "folder": str(cwd)}).encode()
    socket.send_fds(connection, [request], [read, stdout.fileno(), stderr.fileno()])
    os.close(read)
    return Forked(connection, stdin=written)


def _is_forked(argv: Sequence[str], environ: Mapping[str, str]) -> bool:
    """Whether a process with this command and environment imports what the server has imported."""
    if list(argv[:2]) != [sys.executable, "-m"] or argv[2] not in _MAINS:
        return False
    usual = {**os.environ, **PYTHON}
    return all(
        environ.get(name) == usual.get(name)
        for name in environ.keys() | usual.keys()
        if name.startswith(_GONE_BY_AT_THE_START)
    )


def run(
    argv: Sequence[str], *, environ: Mapping[str, str], folder: Path, stdin: str = "", timeout_s: float = 120
) -> "subprocess.CompletedProcess[str]":
    """Run a process to its end and capture its output, as subprocess.run does; fork it if possible."""
    if not _is_forked(argv, environ):
        return subprocess.run(
            argv, cwd=folder, env=environ, input=stdin, capture_output=True, text=True, timeout=timeout_s, check=False
        )
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as talk:
        process = start(
            argv, stdin=subprocess.PIPE, stdout=out, stderr=talk, env=environ, cwd=folder, imported=Imported.COMMANDS
        )
        assert process.stdin is not None
        try:
            with contextlib.suppress(BrokenPipeError), process.stdin as pipe:
                pipe.write(stdin.encode())
            code = process.wait(timeout_s)
        finally:
            process.kill()
        out.seek(0)
        talk.seek(0)
        return subprocess.CompletedProcess(argv, code, out.read(), talk.read())


@functools.cache
def _server(imported: Imported) -> str:
    """The address of this process's server, which is started at the first call."""
    address = f"\0syncrelay-preloaded-{imported}-{os.getpid()}"
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listening:
        listening.bind(address)
        listening.listen(64)
        server = subprocess.Popen(
            [sys.executable, "-m", __spec__.name, imported, str(listening.fileno())],
            stdin=subprocess.PIPE,
            pass_fds=[listening.fileno()],
            # Otherwise numpy starts a thread for each core, and forking a process with threads is unsafe.
            env={**os.environ, **PYTHON, "OPENBLAS_NUM_THREADS": "1"},
        )
    # The server ends when its stdin is closed.
    atexit.register(server.communicate)
    return address


def main() -> None:
    """Serve; in a fork, run what was asked for."""
    # Ctrl-C is handled by the process that started the server, which ends the forks.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    imported, listening_at = sys.argv[1:]
    for name in (*_MAINS.values(), *_OF_NODES, *(_of_commands() if imported == Imported.COMMANDS else ())):
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    for name in _TYPE_SUPPORTS:
        with contextlib.suppress(ImportError):
            _load_type_supports(name)
    # pydantic builds its models for the first file.
    with contextlib.suppress(ConfigError):
        load_text(_ALMOST_A_FILE, environ={})
    # Otherwise the collector visits these objects in each fork, which copies their memory.
    gc.collect()
    gc.freeze()
    # LTTng's two threads are the only ones.
    warnings.filterwarnings("ignore", category=DeprecationWarning, message=".*multi-threaded, use of fork")
    _keep_tracing()
    with socket.socket(fileno=int(listening_at)) as listening:
        request, streams = _served(listening)
    if request is not None:
        code = _run(request, streams)
        # Without DDS, the rest of Python's exit only touches, and so copies, most of the memory.
        if held_by(os.getpid()):
            sys.exit(code)
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        os._exit(code or 0)


def _of_commands() -> Iterator[str]:
    """What commands import as they run."""
    yield "pyarrow.parquet"
    for module in pkgutil.walk_packages(syncrelay.__path__, "syncrelay."):
        if module.name.rpartition(".")[2] not in _NEVER_IMPORTED:
            yield module.name


def _load_type_supports(name: str) -> None:
    from rclpy.type_support import check_for_type_support  # noqa: PLC0415  rclpy may not be there

    for each in vars(importlib.import_module(name)).values():
        if hasattr(type(each), "__import_type_support__"):
            check_for_type_support(each)


def _served(listening: socket.socket) -> tuple[dict[str, Any] | None, Sequence[int]]:
    """Fork for each request and report how each fork ended.

    Returns the request and its streams in a fork, None in the server once its stdin has ended.
    """
    forks: dict[int, tuple[int, socket.socket]] = {}
    with selectors.DefaultSelector() as selector:
        selector.register(sys.stdin.fileno(), selectors.EVENT_READ)
        selector.register(listening, selectors.EVENT_READ)
        while True:
            for key, _ in selector.select():
                if key.fd in forks:
                    selector.unregister(key.fd)
                    os.close(key.fd)
                    _tell_end(*forks.pop(key.fd))
                    continue
                if key.fileobj is not listening:
                    return None, ()
                connection, _ = listening.accept()
                text, streams, _, _ = socket.recv_fds(connection, _LONGEST_REQUEST, 3)
                if not (pid := os.fork()):
                    for fd, (_, other) in forks.items():
                        os.close(fd)
                        other.close()
                    connection.close()
                    return json.loads(text), streams
                for fd in streams:
                    os.close(fd)
                connection.send(str(pid).encode())
                fork = os.pidfd_open(pid)
                forks[fork] = pid, connection
                selector.register(fork, selectors.EVENT_READ)


def _tell_end(pid: int, connection: socket.socket) -> None:
    code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    # Nobody may have waited for it.
    with connection, contextlib.suppress(BrokenPipeError):
        connection.send(str(code).encode())


def _run(request: Mapping[str, Any], streams: Sequence[int]) -> int | None:
    """Run the requested module with the environment, folder and streams of the request."""
    for number, fd in enumerate(streams):
        os.dup2(fd, number)
        os.close(fd)
    # As Python opens them.
    opened: dict[str, IO[str]] = {
        "stdin": os.fdopen(0, closefd=False),
        "stdout": os.fdopen(1, "w", closefd=False),
        "stderr": os.fdopen(2, "w", buffering=1, errors="backslashreplace", closefd=False),
    }
    for name, stream in opened.items():
        setattr(sys, name, stream)
        setattr(sys, f"__{name}__", stream)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.environ.clear()
    os.environ.update(request["environment"])
    os.chdir(request["folder"])
    sys.argv = request["words"]
    code: int | None = importlib.import_module(_MAINS[sys.argv[0]]).main()
    return code


def _keep_tracing() -> None:
    """Call LTTng's hooks at each fork, as its own wrapper of fork() does; LTTng comes with rclpy.

    At its end it waits for two threads that only the hooks restart. Each hook takes room for a signal mask.
    """
    maps = (line.split(maxsplit=5) for line in Path("/proc/self/maps").read_text().splitlines())
    for found in {path for *_, path in maps if re.search(r"/liblttng-ust(-[0-9a-f]+)?\.so", path)}:
        library, mask = ctypes.CDLL(found), ctypes.create_string_buffer(128)
        os.register_at_fork(
            before=functools.partial(library.ust_before_fork, mask),
            after_in_parent=functools.partial(library.ust_after_fork_parent, mask),
            after_in_child=functools.partial(library.ust_after_fork_child, mask),
        )


if __name__ == "__main__":
    main()
