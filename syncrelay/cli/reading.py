"""What surrounds the reading of a recording: a bar, where stderr is a terminal, and a garbage collector at ease."""

import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from rich.console import Console, RenderableType
from rich.progress import BarColumn, DownloadColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

from syncrelay.cli.boundary import AT_FAULT, DONE, remark
from syncrelay.collector import eased_collector
from syncrelay.printable import printable
from syncrelay.recordings.bag import Recording


class _Bar(Progress):
    """Asks the recording where it is whenever it is drawn: reading itself does nothing for it."""

    def __init__(self, recording: Recording, console: Console) -> None:
        self._recording = recording
        self._task: TaskID | None = None
        columns = (TextColumn("reading"), BarColumn(), DownloadColumn(), TimeRemainingColumn())
        super().__init__(*columns, console=console, transient=True)
        self._task = self.add_task("reading", total=recording.size)

    def get_renderables(self) -> Iterable[RenderableType]:
        if self._task is not None:
            self.update(self._task, completed=self._recording.position)
        yield from super().get_renderables()


@contextmanager
def reading(recording: Recording) -> Iterator[None]:
    """Show how far the recording has been read, while it is, with the garbage collector at ease."""
    with eased_collector():
        if not sys.stderr.isatty():
            yield
            return
        with _Bar(recording, Console(stderr=True)):
            yield


def tell_faults(recording: Recording) -> int:
    """Say what of a recording is missing or could not be read, and return the exit code for it."""
    for fault in recording.faults:
        remark(printable(fault))
    return AT_FAULT if recording.faults else DONE
