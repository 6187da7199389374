"""What ROS and the relay write: the log folder, the heartbeat."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from syncrelay.doctor.diagnosis import Diagnosis, error, info


@dataclass(frozen=True, slots=True)
class Written:
    """Where ROS's log and the relay's heartbeat go, and why they cannot be written, None where they can.

    `log_folder` is None where the environment names none; `heartbeat` where none is asked for.
    """

    log_folder: Path | None
    log_named_by: str
    log_fault: str | None
    heartbeat: Path | None = None
    heartbeat_fault: str | None = None


def check_folders(found: Written) -> Iterator[Diagnosis]:
    """Yield what cannot be written."""
    if found.log_folder is None:
        yield _log("ROS has no log folder: HOME, ROS_HOME and ROS_LOG_DIR are all unset")
    elif found.log_fault:
        place = f"{found.log_folder} (by {found.log_named_by})"
        yield _log(f"ROS's log folder cannot be written: {place}: {found.log_fault}")
    if found.heartbeat_fault:
        yield error(
            "heartbeat",
            f"the heartbeat cannot be written: SYNCRELAY_HEARTBEAT={found.heartbeat}: {found.heartbeat_fault}",
            impact="the relay runs, but `syncrelay healthcheck` and a container's health check report that it does not",
            fix="use a file in an existing folder that this user can write to, such as /tmp/syncrelay.heartbeat",
        )


def _log(what: str) -> Diagnosis:
    return info(
        "log_folder",
        what,
        impact="the relay runs without ROS's log file (its own log is on stderr), but other nodes fail to start",
        fix="export ROS_LOG_DIR=/tmp/ros-log    or any other folder that this user can write to",
    )
