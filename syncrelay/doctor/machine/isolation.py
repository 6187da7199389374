"""Whether this is a container, what it shares with its host, and how many processes it may have."""

import os
import resource
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from syncrelay.doctor.container import Isolation
from syncrelay.doctor.network import Interface

_RUNTIMES: Final = ("docker", "containerd", "kubepods", "libpod", "lxc")
# Interfaces that only a host has, beside those with hardware behind them.
_OF_A_HOST: Final = ("docker", "virbr", "br-", "veth", "cni", "podman")


def look_at_isolation(interfaces: Sequence[Interface], *, root: Path = Path("/")) -> Isolation:
    """Return what shuts this process off; the files of the system are read below `root`."""
    limits = sorted(_task_limits(root))
    return Isolation(
        container=_container(root),
        host_network=any(each.hardware or each.name.startswith(_OF_A_HOST) for each in interfaces),
        private_shm=_has_private_shm(_text(root / "proc/self/mountinfo")),
        task_limit=limits[0][0] if limits else None,
        task_limit_of=limits[0][1] if limits else "",
    )


def _container(root: Path) -> str | None:
    for sign in (".dockerenv", "run/.containerenv"):
        if (root / sign).exists():
            return f"/{sign}"
    groups = _text(root / "proc/1/cgroup")
    return next((f"/proc/1/cgroup: {word}" for word in _RUNTIMES if word in groups), None)


def _has_private_shm(mounts: str) -> bool:
    """Whether what is mounted last at /dev/shm is what container engines make for one container: named `shm`."""
    sources = [_source(line) for line in mounts.splitlines() if line.split()[4:5] == ["/dev/shm"]]  # noqa: S108
    return bool(sources) and sources[-1] == "shm"


def _source(line: str) -> str:
    # proc(5): ... - type source options
    return line.partition(" - ")[2].split()[1]


def _task_limits(root: Path) -> Iterator[tuple[int, str]]:
    processes, _ = resource.getrlimit(resource.RLIMIT_NPROC)
    if processes != resource.RLIM_INFINITY and os.geteuid() != 0:
        yield processes, "ulimit -u"
    for group in _pids_groups(root):
        text = _text(group / "pids.max").strip()
        if text.isdecimal():
            yield int(text), f"{group}/pids.max"


def _pids_groups(root: Path) -> Iterator[Path]:
    """Yield the folders of this process's control groups that may limit tasks, of either version, innermost first."""
    for line in _text(root / "proc/self/cgroup").splitlines():
        number, controllers, path = line.split(":", maxsplit=2)
        if number == "0":
            top = root / "sys/fs/cgroup"
        elif "pids" in controllers.split(","):
            top = root / "sys/fs/cgroup/pids"
        else:
            continue
        group = top / path.lstrip("/")
        # In a container the path may be the host's, and what is mounted is the group itself.
        yield from (each for each in (group, *group.parents) if each.is_relative_to(top))


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
