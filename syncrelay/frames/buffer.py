"""Which transforms are known at which times, by the rules of tf2's BufferCore and TimeCache.

Source: ros2/geometry2, tf2/src/buffer_core.cpp and tf2/src/cache.cpp. What is known of an edge are stamps and parents:
whether a transform can be looked up depends on nothing else.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator
from typing import Final, NamedTuple

from syncrelay.sync import Lack, Missing

CACHE_NS: Final = 10_000_000_000
"""tf2 keeps the transforms of an edge for so long before its newest."""

# As tf2's MAX_GRAPH_DEPTH: a longer chain is taken for a loop.
_DEEPEST: Final = 1_000
# Of what anybody may publish: tf2 itself has no limit for frames, and one of a million for the transforms of an edge.
_MOST_FRAMES: Final = 10_000
_MOST_STAMPS: Final = 100_000


class Edge(NamedTuple):
    """A transform from a parent to a child at a time in nanoseconds, or, if it is static, at all times."""

    parent: str
    child: str
    stamp: int
    is_static: bool


class _Parent(NamedTuple):
    """The parent of a frame at some time; or, if there is none, whether its edge is late, and by how much."""

    name: str | None
    lack: Lack | None = None
    by_ns: int = 0


class _Static:
    """The edge above a frame that does not move."""

    def __init__(self, parent: str) -> None:
        self._parent = parent

    def parent(self, _stamp: int) -> _Parent:
        return _Parent(self._parent)

    def latest(self) -> tuple[int, str]:
        """Return 0 for the newest stamp, as all times are alike, and the parent."""
        return 0, self._parent

    def clear(self) -> None:
        """Stay as it is, as in tf2."""


class _Moving:
    """The edge above a frame, whose parent may change, at the times of its transforms."""

    def __init__(self) -> None:
        self._stamps: list[int] = []
        self._parents: list[str] = []
        self._last_parent = ""

    def insert(self, edge: Edge) -> bool:
        """Take a transform; return False if it is older than all that is kept."""
        stamps = self._stamps
        if stamps and edge.stamp + CACHE_NS < stamps[-1]:
            return False
        place = bisect_right(stamps, edge.stamp)
        self._last_parent = edge.parent
        if place and stamps[place - 1] == edge.stamp and self._parents[place - 1] == edge.parent:
            return True
        stamps.insert(place, edge.stamp)
        self._parents.insert(place, edge.parent)
        gone = max(bisect_left(stamps, stamps[-1] - CACHE_NS), len(stamps) - _MOST_STAMPS)
        if gone > 0:
            del stamps[:gone], self._parents[:gone]
        return True

    def parent(self, stamp: int) -> _Parent:
        """Return the parent at a time; at 0, the latest."""
        stamps, parents = self._stamps, self._parents
        if not stamps:
            return _Parent(None, Lack.LATE)
        if stamp in (0, stamps[-1]):
            return _Parent(parents[-1])
        if stamp == stamps[0]:
            return _Parent(parents[0])
        if stamp > stamps[-1]:
            return _Parent(None, Lack.LATE, stamp - stamps[-1])
        if stamp < stamps[0]:
            return _Parent(None, Lack.PAST, stamps[0] - stamp)
        return _Parent(parents[bisect_right(stamps, stamp) - 1])

    def latest(self) -> tuple[int, str] | None:
        """Return the newest stamp and the parent of then; None where nothing is known."""
        return (self._stamps[-1], self._parents[-1]) if self._stamps else None

    def clear(self) -> None:
        """Forget all transforms."""
        self._stamps.clear()
        self._parents.clear()

    @property
    def last_parent(self) -> str:
        """The parent of the transform that came last."""
        return self._last_parent


class _NoChainError(Exception):
    """There is no chain between two frames, at any time."""

    def __init__(self, lack: Lack, frame: str) -> None:
        super().__init__()
        self.lack, self.frame = lack, frame


class Frames:
    """The transforms that were received, as long as tf2 keeps them."""

    def __init__(self) -> None:
        self.version = 0
        """Changes whenever more, or fewer, are known."""
        self._caches: dict[str, _Static | _Moving] = {}
        self._known: set[str] = set()

    def add(self, edge: Edge) -> bool:
        """Take a transform; return whether tf2 would. Frames beyond 10,000 are not kept."""
        child, parent = edge.child.removeprefix("/"), edge.parent.removeprefix("/")
        if not child or not parent or child == parent:
            return False
        if len(self._known) >= _MOST_FRAMES and not {child, parent} <= self._known:
            return False
        self._known |= {child, parent}
        self.version += 1
        if edge.is_static:
            self._caches[child] = _Static(parent)
            return True
        cache = self._caches.get(child)
        if not isinstance(cache, _Moving):
            cache = self._caches[child] = _Moving()
        return cache.insert(edge._replace(parent=parent))

    def clear(self) -> None:
        """Forget all but what is static, as tf2_ros does when the clock jumps back."""
        self.version += 1
        for cache in self._caches.values():
            cache.clear()

    def missing(self, target: str, source: str, stamp: int) -> Missing | None:
        """Return what is missing to transform from a frame to another at a time in ns, at 0 the latest; None if it can.

        As tf2's canTransform, which fails where this returns anything.
        """
        if source == target:
            return None
        if not source or source.startswith("/"):
            return Missing(Lack.NO_FRAME, target, source)
        for frame in (source, target):
            if frame not in self._known:
                return Missing(Lack.UNKNOWN_FRAME, target, frame)
        try:
            return self._walk(target, source, stamp or self._latest_common(target, source))
        except _NoChainError as error:
            return Missing(error.lack, target, error.frame)

    def _walk(self, target: str, source: str, stamp: int) -> Missing | None:
        """Walk up from the source, then from the target to where that ended."""
        top = source
        failed: Missing | None = None
        for frame, parent in self._up(source, stamp):
            if isinstance(parent, Missing):
                top, failed = frame, parent
                break
            if parent is None:
                top = frame
                break
            if frame == target:
                return None
            top = frame
        for frame, parent in self._up(target, stamp):
            if frame == top:
                return None
            if isinstance(parent, Missing):
                return parent
            if parent is None:
                break
            if frame == source:
                return None
        return failed or Missing(Lack.UNCONNECTED, target, source)

    @property
    def _deepest(self) -> int:
        """How deep a frame can lie: what is deeper is in a loop, which so many steps show."""
        return min(_DEEPEST, len(self._caches))

    def _up(self, frame: str, stamp: int) -> Iterator[tuple[str, str | Missing | None]]:
        """Yield a frame and its parent, then that one and its parent; last a root, or one whose edge is missing."""
        for _ in range(self._deepest + 1):
            cache = self._caches.get(frame)
            if cache is None:
                yield frame, None
                return
            found = cache.parent(stamp)
            if found.name is None:
                parent = cache.last_parent if isinstance(cache, _Moving) else ""
                yield frame, Missing(found.lack or Lack.LATE, parent, frame, found.by_ns)
                return
            yield frame, found.name
            frame = found.name
        raise _NoChainError(Lack.LOOP, frame)

    def _latest_common(self, target: str, source: str) -> int:
        """Return the latest time that all edges between two frames have; 0 where all are static."""
        chain = list(self._latest_up(source, until=target))
        if chain and chain[-1][1] == target:
            return _earliest(stamp for stamp, _ in chain)
        above = {parent for _, parent in chain}
        stamps: list[int] = []
        for stamp, parent in self._latest_up(target, until=source):
            stamps.append(stamp)
            if parent in above:
                common = [each for each, _ in chain[: [each for _, each in chain].index(parent) + 1]]
                return _earliest([*stamps, *common])
            if parent == source:
                return _earliest(stamps)
        raise _NoChainError(Lack.UNCONNECTED, source)

    def _latest_up(self, frame: str, *, until: str) -> Iterator[tuple[int, str]]:
        for _ in range(self._deepest + 1):
            cache = self._caches.get(frame)
            latest = cache.latest() if cache is not None else None
            if latest is None:
                return
            yield latest
            frame = latest[1]
            if frame == until:
                return
        raise _NoChainError(Lack.LOOP, frame)


def _earliest(stamps: Iterable[int]) -> int:
    """Return the earliest of the stamps that are of moving edges; 0 where none is."""
    return min(filter(None, stamps), default=0)
