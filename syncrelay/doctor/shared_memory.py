"""Fast DDS's files in /dev/shm: whose they are, whether a process holds them, and whether there is room."""

import os
import pwd
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from syncrelay.config.wording import counted
from syncrelay.doctor.diagnosis import Diagnosis, error, info
from syncrelay.environment.domain import ports_of
from syncrelay.fastdds_files import FOLDER, NAME, is_locked, locks_of

# One participant with the default segment size of 512 kB, and its ports.
_NEEDED: Final = 600_000
_TIGHT: Final = 8_000_000
_MADE_WITHIN_S: Final = 0.05
# Removes only what no process holds a lock on, which is how `fastdds shm clean` decides too.
_CLEAN: Final = """for f in /dev/shm/fast*s_*_[es]l; do flock -n "$f" rm -f "$f" "${f%_?l}"; done"""


@dataclass(frozen=True, slots=True)
class ShmFile:
    """A segment, or the port with this number; `is_live` says whether a process holds it."""

    name: str
    size: int
    uid: int
    owner: str
    is_live: bool
    port: int | None = None


@dataclass(frozen=True, slots=True)
class SharedMemory:
    """Where POSIX shared memory is: why it cannot be used, its bytes, what Fast DDS has in it. `uid` is ours."""

    folder: str
    fault: str | None
    total: int
    free: int
    uid: int
    files: tuple[ShmFile, ...] = ()


def check_shared_memory(found: SharedMemory, *, domain: int | None) -> Iterator[Diagnosis]:
    """Yield what keeps messages from passing through shared memory; None for a domain that is not known."""
    if found.fault:
        yield info(
            "shm_unusable",
            f"{found.folder} cannot be written: {found.fault}",
            impact="Fast DDS uses UDP only; large messages cost more",
            fix="mount a tmpfs there (Docker: --shm-size 64m), or choose UDP: export FASTDDS_BUILTIN_TRANSPORTS=UDPv4",
        )
        return
    yield from _room(found)
    yield from _foreign(found, ports_of(domain) if domain is not None else range(0))
    yield from _empty(found)
    yield from _stale(found)


def _room(found: SharedMemory) -> Iterator[Diagnosis]:
    what = f"{_size(found.free)} of {_size(found.total)} are free in {found.folder}"
    if found.free < _NEEDED:
        yield error(
            "shm_full",
            f"{what}; one node needs {_size(_NEEDED)}",
            impact="nodes start without shared memory, and peers that expect it may get no data",
            fix="free it (see `df -h /dev/shm`, `ls -l /dev/shm`), or make it larger\n"
            "(mount -o remount,size=64M /dev/shm, Docker: --shm-size 64m)",
        )
    elif found.free < _TIGHT:
        yield info(
            "shm_tight",
            what,
            impact=f"each node takes {_size(_NEEDED)}, more with a larger segment_size: the next may find no room",
            fix="make it larger (mount -o remount,size=64M /dev/shm, Docker: --shm-size 64m)",
        )


def _foreign(found: SharedMemory, ports: range) -> Iterator[Diagnosis]:
    """Of live ports only: a segment does not tell its domain. Root may open all, but others cannot open root's."""
    here = [each for each in found.files if each.is_live and each.uid != found.uid]
    in_domain = sorted({each.owner for each in here if each.port in ports})
    if in_domain:
        yield error(
            "shm_foreign",
            f"nodes of another user ({', '.join(in_domain)}) run on this domain and use shared memory",
            impact="their topics are listed, but no data arrives: neither user may open the other's files in /dev/shm",
            fix="run all nodes as one user, or on both sides: export FASTDDS_BUILTIN_TRANSPORTS=UDPv4",
        )
    elsewhere = sorted({each.owner for each in here if each.port is None} - set(in_domain))
    if elsewhere:
        yield info(
            "shm_foreign",
            f"processes of another user ({', '.join(elsewhere)}) use DDS over shared memory, perhaps on other domains",
            impact="if you need their topics: they are listed, but no data passes from user to user",
            fix="nothing if you don't; otherwise on both sides: export FASTDDS_BUILTIN_TRANSPORTS=UDPv4",
        )


def _empty(found: SharedMemory) -> Iterator[Diagnosis]:
    """Ports that were made and never written: Fast DDS waits for who made them, and no signal is heard."""
    empty = [f"{found.folder}/{each.name}" for each in found.files if each.is_live and each.port and not each.size]
    if empty:
        yield error(
            "shm_empty",
            f"{', '.join(empty)}: empty, and Fast DDS waits for its content",
            impact="a node that comes to such a port hangs as it starts, forever, and only SIGKILL ends it",
            fix=f"rm -f {' '.join(empty)}\nand kill -9 what hangs",
        )


def _stale(found: SharedMemory) -> Iterator[Diagnosis]:
    stale = [each for each in found.files if not each.is_live]
    if not stale:
        return
    owners = sorted({each.owner for each in stale if each.uid != found.uid})
    size = _size(sum(each.size for each in stale))
    whose = f", some of {', '.join(owners)}" if owners else ""
    yield info(
        "shm_stale",
        f"{counted(len(stale), 'Fast DDS file')} in /dev/shm left by processes that were killed: {size}{whose}",
        impact="they take up memory until somebody removes them; messages are not affected",
        fix=f"at any time, in bash{' as root' if owners else ''}; files in use are left alone:\n{_CLEAN}",
    )


def _size(count: int) -> str:
    for unit, size in (("GB", 1_000_000_000), ("MB", 1_000_000), ("kB", 1_000)):
        if count >= size:
            return f"{count / size:.{0 if count >= 10 * size else 1}f} {unit}"
    return f"{count} B"


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
            if not status.st_size:
                # Perhaps it is being made.
                time.sleep(_MADE_WITHIN_S)
                status = path.stat()
        except FileNotFoundError:
            # Its process ended just now.
            continue
        port = int(found[1]) if found[1] else None
        # A process holds a lock beside its files; without a lock file that cannot be told.
        locks = locks_of(path)
        is_live = not locks or any(map(is_locked, locks))
        yield ShmFile(path.name, status.st_size, status.st_uid, _user(status.st_uid), is_live, port)


def _user(uid: int) -> str:
    try:
        return pwd.getpwuid(uid).pw_name
    except KeyError:
        return f"uid {uid}"
