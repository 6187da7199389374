"""What a container shares with its host, and how many processes it may have."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from syncrelay.doctor.diagnosis import Diagnosis, error
from syncrelay.doctor.transport import uses_shared_memory
from syncrelay.environment.domain import range_of

# Measured: rclpy with Fast DDS crashes at 10 threads and runs at 30.
_FEWEST_TASKS: Final = 30


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
