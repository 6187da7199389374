"""What a container shares with its host, and how many processes it may have."""

import os
import resource
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from syncrelay.doctor.diagnosis import Diagnosis, error
from syncrelay.doctor.network import Interface
from syncrelay.doctor.transport import uses_shared_memory
from syncrelay.environment.domain import range_of

# Measured: rclpy with Fast DDS crashes at 10 threads and runs at 30.
_FEWEST_TASKS: Final = 30
_RUNTIMES: Final = ("docker", "containerd", "kubepods", "libpod", "lxc")
# Interfaces that only a host has, beside those with hardware behind them.
_OF_A_HOST: Final = ("docker", "virbr", "br-", "veth", "cni", "podman")


@dataclass(frozen=True, slots=True)
class Isolation:
    """What shuts this process off; `container` names the sign by which one is known, None outside of one.

    `task_limit` is the least of the limits on processes and threads, None for none, with who sets it.
    """

    container: str | None
    host_network: bool
    private_shm: bool
    task_limit: int | None = None
    task_limit_of: str = ""


def check_isolation(found: Isolation, environ: Mapping[str, str]) -> Iterator[Diagnosis]:
    """Yield combinations of network and memory that list topics without bringing data, and limits too low."""
    if found.task_limit is not None and found.task_limit < _FEWEST_TASKS:
        yield error(
            "task_limit",
            f"only {found.task_limit} processes and threads are allowed here ({found.task_limit_of})",
            impact=f"rclpy crashes when it starts its threads: it needs {_FEWEST_TASKS}",
            fix="raise the limit (Docker: --pids-limit 64, compose: pids_limit: 64, shell: ulimit -u)",
        )
    if found.container is None or not (found.host_network and found.private_shm):
        return
    if uses_shared_memory(environ):
        yield error(
            "private_shm",
            f"this container has the host's network but a /dev/shm of its own ({found.container})",
            impact="Fast DDS takes nodes outside for local ones and offers them shared memory that they cannot see:\n"
            "their topics are listed, but no data arrives",
            fix="export FASTDDS_BUILTIN_TRANSPORTS=UDPv4    in the container; or share the memory, as the same user:\n"
            "docker run --ipc host --user UID",
        )
    elif range_of(environ) == "LOCALHOST":
        yield error(
            "private_shm",
            "this container has the host's network, uses UDP, and discovery is limited to LOCALHOST",
            impact="nodes outside the container are listed, but no data arrives from them",
            fix="unset ROS_AUTOMATIC_DISCOVERY_RANGE ROS_LOCALHOST_ONLY    in the container",
        )


def look_at_isolation(interfaces: Sequence[Interface], *, root: Path = Path("/")) -> Isolation:
    """Return what shuts this process off; the files of the system are read below `root`."""
    limits = sorted(_task_limits(root))
    mounts = _text(root / "proc/self/mountinfo").splitlines()
    # proc(5): ... mount point ... - type source options
    sources = [line.partition(" - ")[2].split()[1] for line in mounts if line.split()[4:5] == ["/dev/shm"]]  # noqa: S108
    return Isolation(
        container=_container(root),
        host_network=any(each.hardware or each.name.startswith(_OF_A_HOST) for each in interfaces),
        # What is mounted there last is what container engines make for one container.
        private_shm=sources[-1:] == ["shm"],
        task_limit=limits[0][0] if limits else None,
        task_limit_of=limits[0][1] if limits else "",
    )


def _container(root: Path) -> str | None:
    for sign in (".dockerenv", "run/.containerenv"):
        if (root / sign).exists():
            return f"/{sign}"
    groups = _text(root / "proc/1/cgroup")
    return next((f"/proc/1/cgroup: {word}" for word in _RUNTIMES if word in groups), None)


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
