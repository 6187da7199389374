"""What ROS and the relay write, the log folder and the heartbeat: tried, without a trace."""

import errno
import os
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

from syncrelay.doctor.diagnosis import Diagnosis, error, info
from syncrelay.ros.environment import log_folder

# As cli/healthcheck has it, which is above this room.
_HEARTBEAT: Final = "SYNCRELAY_HEARTBEAT"


def check_folders(environ: Mapping[str, str]) -> Iterator[Diagnosis]:
    """Yield what cannot be written: ROS's log, and the relay's heartbeat, if one is asked for."""
    folder = log_folder(environ)
    if folder is None:
        yield _log("ROS has no log folder: HOME, ROS_HOME and ROS_LOG_DIR are all unset")
    elif fault := _folder_fault(folder, may_make=True):
        named_by = next(name for name in ("ROS_LOG_DIR", "ROS_HOME", "HOME") if environ.get(name))
        yield _log(f"ROS's log folder cannot be written: {folder} (by {named_by}): {fault}")
    if (beat := environ.get(_HEARTBEAT)) and (fault := _file_fault(Path(beat))):
        yield error(
            "heartbeat",
            f"the heartbeat cannot be written: {_HEARTBEAT}={beat}: {fault}",
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
