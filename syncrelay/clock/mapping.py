"""The stamps of many messages at once, mapped as they are one by one where they are received."""

from collections.abc import Iterable, Iterator
from typing import Final

from syncrelay.clock.device_clock import DeviceClock

UNREADABLE: Final = -(2**63)
"""Stands in place of a stamp that could not be read."""


def host_times(clock: DeviceClock, stamps: Iterable[int], received: Iterable[int]) -> Iterator[int]:
    """Yield the host's time of each stamp, in the order of receipt. What is UNREADABLE stays so."""
    for stamp, at in zip(stamps, received, strict=True):
        yield stamp if stamp == UNREADABLE else clock.host_time(stamp, at)
