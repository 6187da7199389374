"""Frames at a fixed rate: each shows the set whose stamp is nearest to its time."""

from typing import Final

from syncrelay.config.units import NS_PER_UNIT
from syncrelay.errors import BagError

_NS_PER_S: Final = NS_PER_UNIT["s"]


class Grid:
    """Gives the frames at `fps`, from the first set's stamp on, to sets in the order of their stamps.

    Nothing is interpolated. A set that several frames are nearest to is repeated, one that no frame is nearest to is
    left out. Of two sets that are equally near, a frame shows the earlier.
    """

    def __init__(self, *, fps: int, max_gap_ns: int) -> None:
        self._fps = fps
        self._max_gap = max_gap_ns
        self._first: int | None = None
        self._last = 0
        self.frames = 0
        """How many frames there are so far."""
        self.held = 0
        """How many frames repeat the set of the frame before."""
        self.left_out = 0
        """How many sets no frame shows."""
        self.farthest_ns = 0
        """The longest time between a frame and its set."""

    def next_set(self, stamp: int) -> int:
        """Return how many frames show the set before this one; 0 for the first set.

        Raises BagError where stamps fall, or rise by more than the longest gap.
        """
        if self._first is None:
            self._first = self._last = stamp
            return 0
        step, after = stamp - self._last, _seconds(self._last - self._first)
        if step < 0:
            raise BagError(
                f"stamps of sets fall by {_seconds(-step)} after {after}: an episode is one run of time, so cut the"
                " recording there"
            )
        if step > self._max_gap:
            raise BagError(
                f"no set for {_seconds(step)} after {after}, expected {_seconds(self._max_gap)} at most: cut the"
                " recording there, or write a longer `max_gap`"
            )
        count = self._frames_until((self._last + stamp - 2 * self._first) * self._fps)
        self._last = stamp
        return count

    def end(self) -> int:
        """Return how many frames show the last set: those up to half a frame after it."""
        if self._first is None:
            return 0
        return self._frames_until(2 * (self._last - self._first) * self._fps + _NS_PER_S)

    def _frames_until(self, doubled: int) -> int:
        """Give the frames up to a time to the last set; `doubled` is twice the ns since the first set, times `fps`."""
        count = max(0, doubled // (2 * _NS_PER_S) + 1 - self.frames)
        if not count:
            self.left_out += 1
            return 0
        elapsed = (self._last - (self._first or 0)) * self._fps
        ends = (self.frames, self.frames + count - 1)
        farthest = max(abs(number * _NS_PER_S - elapsed) for number in ends) // self._fps
        self.farthest_ns = max(self.farthest_ns, farthest)
        self.held += count - 1
        self.frames += count
        return count


def _seconds(ns: int) -> str:
    return f"{ns / _NS_PER_S:.3g} s"
