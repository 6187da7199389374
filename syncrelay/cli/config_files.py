"""Whether a file has changed, however it was replaced."""

from pathlib import Path


class FileChanges:
    """Watches one file, behind whatever links lead to it: a mounted volume changes them, not the file."""

    def __init__(self, path: str) -> None:
        self._path = Path(path)
        self._known = self._mark()

    def seen(self) -> bool:
        """Whether it has changed since this was last asked; not while it is gone."""
        mark = self._mark()
        if mark is None or mark == self._known:
            return False
        self._known = mark
        return True

    def _mark(self) -> tuple[int, int, int] | None:
        try:
            status = self._path.stat()
        except OSError:
            return None
        return status.st_ino, status.st_mtime_ns, status.st_size
