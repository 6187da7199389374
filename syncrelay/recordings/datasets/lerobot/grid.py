"""Which set is which frame: frames stand at fixed distances, and each is the set that is nearest to its time."""

from typing import Final

from syncrelay.config.units import NS_PER_UNIT
from syncrelay.errors import BagError

_NS_PER_S: Final = NS_PER_UNIT["s"]


class Grid:
    """Frames at `fps` from the first set's stamp on, given to sets in the order of their stamps.

    Nothing is interpolated. A set that several frames are nearest to is held; one that no frame is nearest to is left
    out. Of two sets equally near, the earlier is taken.
    """

    def __init__(self, *, fps: int, max_gap_ns: int) -> None:
        self._fps = fps
        self._max_gap = max_gap_ns
        self._first: int | None = None
        self._last = 0
        self.frames = 0
        """How many frames sets were given to so far."""
        self.held = 0
        """How many of them show the set of the frame before."""
        self.left_out = 0
        """How many sets are no frame."""
        self.farthest_ns = 0
        """The longest time between a frame and its set."""

    def next_set(self, stamp: int) -> int:
        """Return how many frames the set before takes, now that the next one is known; 0 for the first.

        Raises BagError where stamps fall, or rise by more than the gap that is allowed.
        """
        if self._first is None:
            self._first = self._last = stamp
            return 0
        step = stamp - self._last
        if step < 0:
            raise BagError(
                f"stamps of sets fall by {_seconds(-step)} after {_seconds(self._last - self._first)}: an episode is"
                " one run of time, so cut the recording there"
            )
        if step > self._max_gap:
            raise BagError(
                f"no set for {_seconds(step)} after {_seconds(self._last - self._first)}, expected"
                f" {_seconds(self._max_gap)} at most: cut the recording there, or write a longer `max_gap`"
            )
        # Twice the time from the first frame to the middle between the two sets.
        taken = self._take((self._last + stamp - 2 * self._first) * self._fps)
        self._last = stamp
        return taken

    def end(self) -> int:
        """Return how many frames the last set takes: those up to half a frame after it."""
        if self._first is None:
            return 0
        return self._take(2 * (self._last - self._first) * self._fps + _NS_PER_S)

    def _take(self, doubled: int) -> int:
        """Give the set before all frames up to a time, which is doubled and in frames times nanoseconds."""
        until = doubled // (2 * _NS_PER_S) + 1
        count = max(0, until - self.frames)
        if count:
            elapsed = (self._last - (self._first or 0)) * self._fps
            ends = (self.frames, self.frames + count - 1)
            far = max(abs(number * _NS_PER_S - elapsed) for number in ends) // self._fps
            self.farthest_ns = max(self.farthest_ns, far)
            self.held += count - 1
        else:
            self.left_out += 1
        self.frames += count
        return count


def _seconds(ns: int) -> str:
    return f"{ns / _NS_PER_S:.3g} s"
