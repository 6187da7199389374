"""Fast DDS's files in /dev/shm: segments and ports, each with locks beside it, and who has them.

Fast DDS counts a port's users in the port itself: after one was killed, the last to leave does not remove it.
"""

import contextlib
import fcntl
import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final

FOLDER: Final = Path("/dev/shm")  # noqa: S108  where POSIX shared memory is on Linux
# Fast DDS 3 (Kilted) writes fastdds_ where Fast DDS 2 (Jazzy) writes fastrtps_.
NAME: Final = re.compile(r"fast(?:rtps|dds)_(?:[0-9a-z]{16}|port([0-9]{1,5}))")
_BESIDE: Final = re.compile(rf"(?:sem\.)?(?P<name>{NAME.pattern})(?:_el|_sl|_mutex)?")


def locks_of(path: Path) -> list[Path]:
    """The lock files beside a segment or a port: of its owner, and of those that share it."""
    return [lock for lock in (path.with_name(f"{path.name}_el"), path.with_name(f"{path.name}_sl")) if lock.exists()]


def is_locked(lock: Path) -> bool:
    """Whether a process holds a lock, or forbids us to look."""
    try:
        with lock.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return True
    return False


def held_by(pid: int, folder: Path = FOLDER) -> set[str]:
    """The names of the segments and ports that a process has mapped or open; none if we may not look at it."""
    found = (_BESIDE.fullmatch(file.removeprefix(f"{folder}/")) for file in _files_of(Path(f"/proc/{pid}")))
    return {match["name"] for match in found if match}


def ports_among(numbers: range, folder: Path = FOLDER) -> set[str]:
    """The names of the ports that exist with these numbers, whoever has or left them."""
    found = (NAME.fullmatch(path.name) for path in folder.glob("*port*"))
    return {match[0] for match in found if match and match[1] and int(match[1]) in numbers}


def remove_unused(names: Iterable[str], folder: Path = FOLDER) -> None:
    """Remove those of these segments and ports that no other process holds, each with what stands beside it.

    What this process itself still holds does not count: the demo's relay frees it only as Python ends, and needs no
    names for that.
    """
    others = {int(each.name) for each in Path("/proc").iterdir() if each.name.isdecimal()} - {os.getpid()}
    # Exclusive ones: what we hold, no other does.
    ours = {file for file in _files_of(Path("/proc/self")) if file.endswith("_el")}
    for name in set(names).difference(*(held_by(pid, folder) for pid in others)):
        path = folder / name
        locks = locks_of(path)
        # Processes of other containers and users are not seen in /proc.
        if any(is_locked(lock) for lock in locks if str(lock) not in ours):
            continue
        for file in (path, *locks, path.with_name(f"sem.{name}_mutex")):
            with contextlib.suppress(OSError):
                file.unlink(missing_ok=True)


def _files_of(process: Path) -> Iterator[str]:
    """What a process has mapped or open; names of removed files end with ` (deleted)`."""
    try:
        for line in (process / "maps").read_text(errors="replace").splitlines():
            yield from line.split(maxsplit=5)[5:]
        descriptors = list((process / "fd").iterdir())
    except OSError:
        return
    for each in descriptors:
        try:
            yield str(each.readlink())
        except OSError:
            continue
