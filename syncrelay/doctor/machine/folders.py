"""Whether what ROS and the relay write can be written: tried, without a trace."""

import errno
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path

from syncrelay.doctor.folders import Written
from syncrelay.ros.environment import log_folder


def look_at_folders(environ: Mapping[str, str], *, heartbeat_variable: str) -> Written:
    """Return where ROS's log and the heartbeat go, and what keeps them from it."""
    folder = log_folder(environ)
    named_by = next((name for name in ("ROS_LOG_DIR", "ROS_HOME", "HOME") if environ.get(name)), "")
    beat = environ.get(heartbeat_variable)
    return Written(
        log_folder=folder,
        log_named_by=named_by,
        log_fault=_folder_fault(folder) if folder else None,
        heartbeat=Path(beat) if beat else None,
        heartbeat_fault=_file_fault(Path(beat)) if beat else None,
    )


def _folder_fault(folder: Path) -> str | None:
    # Asked by making it, as ROS itself would: as root, a look at the permissions proves nothing.
    try:
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
        return _folder_fault_of_a_file(path.parent)
    except OSError as error:
        return "it is a symbolic link, which is not followed" if error.errno == errno.ELOOP else error.strerror
    return None


def _folder_fault_of_a_file(folder: Path) -> str | None:
    try:
        with tempfile.TemporaryFile(dir=folder):
            return None
    except OSError as error:
        return error.strerror
