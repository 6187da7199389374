"""The state of a running relay for programs: as JSON and as metrics, over HTTP."""

from syncrelay.status.document import Level, Phase, Status, read_status
from syncrelay.status.state import RelayState, advice, group_of, is_ready, level, status_of
from syncrelay.status.taps import Taps

__all__ = [
    "Level",
    "Phase",
    "RelayState",
    "Status",
    "Taps",
    "advice",
    "group_of",
    "is_ready",
    "level",
    "read_status",
    "status_of",
]
