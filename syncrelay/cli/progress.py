"""A bar on stderr that shows how far a recording has been read; nothing where stderr is no terminal."""

import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from rich.console import Console, RenderableType
from rich.progress import BarColumn, DownloadColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

from syncrelay.bag import Recording


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
def progress_of(recording: Recording) -> Iterator[None]:
    """Show the bar while the recording is read."""
    if not sys.stderr.isatty():
        yield
        return
    with _Bar(recording, Console(stderr=True)):
        yield
