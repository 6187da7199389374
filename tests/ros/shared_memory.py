"""What Fast DDS leaves in /dev/shm when a process is killed: which of it was ours.

Segments carry a random number in their names: only a living process tells which are its own, by what it has
mapped. Ports carry the number of a UDP port of their domain, but for those from 7000 on, of which each process
takes the first that is free on the machine, whatever its domain. These are left alone: one stays even after an
orderly end if a process of another domain looked at it just then, and whoever starts next takes it over.

A message to such a port may be meant for one who had it before, of another domain: whoever gets it maps the sender's
segment. So what a living process still has is not left, and not ours to remove.
"""

from collections.abc import Iterable
from pathlib import Path

from tests.ros.domain import ports_of

_FOLDER = Path("/dev/shm")  # noqa: S108  where POSIX shared memory is on Linux
_PREFIXES = ("fastrtps_", "fastdds_")  # of Fast DDS 2 (Jazzy) and 3 (Kilted)


def segments_of(pid: int) -> set[Path]:
    """The segments that a process has mapped, its own and its peers'; none if it is gone."""
    try:
        maps = Path(f"/proc/{pid}/maps").read_text()
    except OSError:
        return set()
    mapped = {Path(line.split(maxsplit=5)[5]) for line in maps.splitlines() if f"{_FOLDER}/" in line}
    return {path for path in mapped if path.name.startswith(_PREFIXES) and "port" not in path.name}


def left_of(domain: int, segments: Iterable[Path]) -> set[Path]:
    """What still exists of a domain's ports, and of the segments that its processes had mapped and no process has."""
    ports = [_FOLDER / f"{prefix}port{port}" for prefix in _PREFIXES for port in ports_of(domain)]
    living = (int(each.name) for each in Path("/proc").iterdir() if each.name.isdecimal())
    unused = set(segments).difference(*map(segments_of, living))
    files = {file for path in (*ports, *unused) for file in (path, *_companions(path))}
    return {file for file in files if file.exists()}


def _companions(path: Path) -> tuple[Path, Path]:
    """The lock that tells whether a file is in use, and the semaphore of a port."""
    return path.with_name(f"{path.name}_el"), path.with_name(f"sem.{path.name}_mutex")
