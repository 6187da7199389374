"""What ROS and the relay write, the log folder and the heartbeat: tried, without a trace."""

import errno
import os
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from syncrelay.doctor.diagnosis import Diagnosis, error, info
from syncrelay.ros.environment import log_folder


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


def look_at_folders(environ: Mapping[str, str], *, heartbeat_variable: str) -> Written:
    """Return where ROS's log and the heartbeat go, and what keeps them from it."""
    folder = log_folder(environ)
    named_by = next((name for name in ("ROS_LOG_DIR", "ROS_HOME", "HOME") if environ.get(name)), "")
    beat = environ.get(heartbeat_variable)
    return Written(
        log_folder=folder,
        log_named_by=named_by,
        log_fault=_folder_fault(folder, may_make=True) if folder else None,
        heartbeat=Path(beat) if beat else None,
        heartbeat_fault=_file_fault(Path(beat)) if beat else None,
    )


def _folder_fault(folder: Path, *, may_make: bool = False) -> str | None:
    """Return why no file can be written in a folder. With `may_make`, one that is missing is made, as ROS would do."""
    try:
        if may_make:
            folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return None
    except OSError as error:
        return error.strerror


def _file_fault(path: Path) -> str | None:
    """Why a file cannot be written; one that is there is left as it is, for a relay may use it now."""
    try:
        os.close(os.open(path, os.O_WRONLY | os.O_NOFOLLOW | os.O_CLOEXEC))
    except FileNotFoundError:
        return _folder_fault(path.parent)
    except OSError as error:
        return "it is a symbolic link, which is not followed" if error.errno == errno.ELOOP else error.strerror
    return None
