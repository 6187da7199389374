"""The state of a running relay for programs: as JSON and as metrics, over HTTP."""

from syncrelay.status.state import Level, Phase, RelayState, advice, is_ready, level
from syncrelay.status.taps import Taps

__all__ = [
    "Level",
    "Phase",
    "RelayState",
    "Taps",
    "advice",
    "is_ready",
    "level",
]
