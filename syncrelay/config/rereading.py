"""The relay's files, read again on a thread of its own, so that a pipe or a file system that hangs delays nothing."""

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from pathlib import Path
from types import TracebackType
from typing import Final, NamedTuple, Self

from syncrelay.config.load import Config, load
from syncrelay.config.problems import ConfigError, Problem
from syncrelay.runtime import SYSTEM, Runtime
from syncrelay.yaml_files import yaml_files

# `syncrelay reload` waits for 10 s.
_PATIENCE_S: Final = 6.0
# How long a pipe may take to end, which has an error of its own.
_PIPE_S: Final = 5.0
_LOOK_S: Final = 0.5
# A file that is written in place or copied over a slow link may be half-written. NFS shows a change up to 3 s late.
_SETTLED_S: Final = 3.0


class Reading(NamedTuple):
    """The result of reading the files: a Config, or the exception. `asked` are requests that wait for it."""

    config: Future[Config]
    asked: tuple[Future[str], ...]


class _Request(NamedTuple):
    since: float
    told: Future[str]


class ConfigFiles:
    """Reads files again on request, and if they are watched, when one has changed or is gone.

    A context manager. Leaving it does not wait for a read that hangs: the thread ends with the process.
    """

    def __init__(self, paths: Sequence[str], *, watched: bool, runtime: Runtime = SYSTEM) -> None:
        """Note the state of the files: changes are seen from here on."""
        self._runtime = runtime
        self._paths = tuple(paths)
        self._known = self._marks() if watched else None
        self._seen = self._known
        self._seen_since = 0.0
        self._lock = runtime.lock()
        self._rest = runtime.rest()
        self._is_wanted = False
        self._ended = False
        self._waiting: list[_Request] = []
        self._read: Reading | None = None
        self._done: Callable[[], None] = lambda: None

    def __enter__(self) -> Self:
        self._runtime.start("syncrelay-files", self._run, daemon=True)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ended = True
        self._rest.set()

    def call_when_read(self, done: Callable[[], None]) -> None:
        """Call `done`, on the thread that reads, when there is something to take."""
        self._done = done

    def read_again(self) -> Future[str]:
        """Ask for the files to be read. Any thread.

        Whoever takes the reading sets the future's result: what the reading led to, in words.
        """
        request = _Request(self._runtime.monotonic(), self._runtime.future())
        with self._lock:
            self._waiting.append(request)
            self._is_wanted = True
        self._rest.set()
        return request.told

    def take(self) -> Reading | None:
        """Return what was read since the last call, None if nothing was.

        A request that has waited too long gets a ConfigError. If its read ends after all, the Config is returned then.
        """
        with self._lock:
            read, self._read = self._read, None
            if read is not None:
                return read
            latest = self._runtime.monotonic() - _PATIENCE_S
            late = tuple(request.told for request in self._waiting if request.since < latest)
            self._waiting = [request for request in self._waiting if request.since >= latest]
        return Reading(self._failed(), late) if late else None

    def _run(self) -> None:
        while not self._ended:
            self._rest.wait(None if self._known is None else _LOOK_S)
            if self.have_changed(now=self._runtime.monotonic()):
                self.read_again()
            if self._is_wanted and not self._ended:
                self._read_now()

    def _read_now(self) -> None:
        with self._lock:
            # Requests during the read are for a later one, as the files may have changed.
            self._is_wanted = False
            asked = list(self._waiting)
        read: Future[Config] = self._runtime.future()
        try:
            read.set_result(load(*self._paths, patience_s=_PIPE_S))
        except BaseException as error:  # noqa: BLE001  it is raised where the result is asked for
            read.set_exception(error)
        with self._lock:
            told = [request.told for request in self._waiting if request in asked]
            self._waiting = [request for request in self._waiting if request not in asked]
            if told or not read.exception():
                earlier = self._read.asked if self._read is not None else ()
                self._read = Reading(read, (*earlier, *told))
        self._done()

    def _failed(self) -> Future[Config]:
        failed: Future[Config] = self._runtime.future()
        text = f"could not be read within {_PATIENCE_S:g} s"
        failed.set_exception(ConfigError([Problem(", ".join(self._paths), "", text, "unreadable")]))
        return failed

    def have_changed(self, *, now: float) -> bool:
        """Whether watched files have changed since this last returned True, and then rested for some seconds."""
        if self._known is None:
            return False
        marks = self._marks()
        if marks != self._seen:
            self._seen, self._seen_since = marks, now
        if marks == self._known or now - self._seen_since < _SETTLED_S:
            return False
        self._known = marks
        return True

    def _marks(self) -> dict[str, tuple[int, int, int] | None]:
        return {file: _mark(Path(file)) for path in self._paths for file in yaml_files(path)}


def _mark(path: Path) -> tuple[int, int, int] | None:
    """Return what identifies the content of a file. Links are followed, as mounted volumes change the links."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_ino, status.st_mtime_ns, status.st_size
