"""What Fast DDS leaves in /dev/shm when a process is killed: which of it was ours.

Segments carry a random number in their names, ports the number of a UDP port: one of the domain's, or one from
7000 on, whichever is free on the machine. Only a living process tells what it uses, by what it has mapped.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from tests.ros.domain import ports_of

_FOLDER = Path("/dev/shm")  # noqa: S108  where POSIX shared memory is on Linux
_PREFIX = "fastrtps_"


class Mapped(NamedTuple):
    """A file of Fast DDS that a process has mapped. A file of that name with another inode is somebody else's."""

    path: Path
    inode: int


def mapped_by(pid: int) -> set[Mapped]:
    """What a process has mapped, its own and its peers'; nothing if it is gone or not ours to ask."""
    try:
        maps = Path(f"/proc/{pid}/maps").read_text()
    except (FileNotFoundError, ProcessLookupError, PermissionError):
        return set()
    rows = [line.split(maxsplit=5) for line in maps.splitlines() if f"{_FOLDER}/{_PREFIX}" in line]
    return {Mapped(Path(row[5]), int(row[4])) for row in rows if Path(row[5]).name.startswith(_PREFIX)}


def left_of(domain: int, mapped: Iterable[Mapped]) -> set[Path]:
    """What still exists of a domain's ports, and of what its processes had mapped and nobody maps now."""
    in_use = {one for process in Path("/proc").glob("[0-9]*") for one in mapped_by(int(process.name))}
    ours = {one.path for one in mapped if one not in in_use and _inode(one.path) in (one.inode, None)}
    ours |= {_FOLDER / f"{_PREFIX}port{port}" for port in ports_of(domain)}
    files = {file for path in ours for file in (path, *_companions(path))}
    return {file for file in files if file.exists()}


def _inode(path: Path) -> int | None:
    return path.stat().st_ino if path.exists() else None


def _companions(path: Path) -> tuple[Path, Path]:
    """The lock that tells whether a file is in use, and the semaphore of a port."""
    return path.with_name(f"{path.name}_el"), path.with_name(f"sem.{path.name}_mutex")
