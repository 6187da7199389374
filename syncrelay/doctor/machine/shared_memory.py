"""What Fast DDS has in /dev/shm. A file is in use while a process holds the lock beside it (`fastdds shm clean`)."""

import os
import pwd
import tempfile
from collections.abc import Iterator
from pathlib import Path

from syncrelay.doctor.shared_memory import SharedMemory, ShmFile
from syncrelay.fastdds_files import FOLDER, NAME, is_locked, locks_of


def look_at_shared_memory(folder: Path = FOLDER) -> SharedMemory:
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
        found = NAME.fullmatch(path.name)
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
    locks = locks_of(path)
    return not locks or any(map(is_locked, locks))


def _user(uid: int) -> str:
    try:
        return pwd.getpwuid(uid).pw_name
    except KeyError:
        return f"uid {uid}"
