"""Where every message of an input went: fed = matched + dropped + buffered, at any moment."""

from collections.abc import Mapping
from dataclasses import dataclass

from syncrelay.sync.messages import DropReason


@dataclass(frozen=True, slots=True)
class InputCounts:
    """Messages of one input since the group was made. `dropped` holds only reasons that occurred."""

    fed: int
    matched: int
    dropped: Mapping[DropReason, int]
    buffered: int
