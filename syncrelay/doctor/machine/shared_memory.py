"""What Fast DDS has in /dev/shm. A file is in use while a process holds the lock beside it (`fastdds shm clean`)."""

import fcntl
import os
import pwd
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from syncrelay.doctor.shared_memory import SharedMemory, ShmFile

_FOLDER: Final = Path("/dev/shm")  # noqa: S108  where POSIX shared memory is on Linux
# Fast DDS 3 (Kilted) writes fastdds_ where Fast DDS 2 (Jazzy) writes fastrtps_.
_NAME: Final = re.compile(r"fast(?:rtps|dds)_(?:[0-9a-z]{16}|port([0-9]{1,5}))")


def look_at_shared_memory(folder: Path = _FOLDER) -> SharedMemory:
    """Return how much room there is, and every segment and port with its owner."""
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
        room = os.statvfs(folder)
    except OSError as error:
        return SharedMemory(str(folder), error.strerror, total=0, free=0, uid=os.geteuid())
    total, free = room.f_blocks * room.f_frsize, room.f_bavail * room.f_frsize
    return SharedMemory(str(folder), None, total=total, free=free, uid=os.geteuid(), files=tuple(_files(folder)))


def _files(folder: Path) -> Iterator[ShmFile]:
    for path in sorted(folder.glob("fast*_*")):
        found = _NAME.fullmatch(path.name)
        if found is None:
            continue
        try:
            status = path.stat()
        except FileNotFoundError:
            # Its process ended just now.
            continue
        port = int(found[1]) if found[1] else None
        yield ShmFile(path.name, status.st_size, status.st_uid, _user(status.st_uid), _is_live(path), port)


def _is_live(path: Path) -> bool:
    """Whether a process holds a lock beside a file; without a lock file that cannot be told, and counts as live."""
    locks = [lock for lock in (path.with_name(f"{path.name}_el"), path.with_name(f"{path.name}_sl")) if lock.exists()]
    return not locks or any(_is_locked(lock) for lock in locks)


def _is_locked(lock: Path) -> bool:
    try:
        with lock.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return True
    return False


def _user(uid: int) -> str:
    try:
        return pwd.getpwuid(uid).pw_name
    except KeyError:
        return f"uid {uid}"
