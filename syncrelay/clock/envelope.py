"""The line under the delays of messages: what a clock does, below what the way to us adds.

Of all lines that touch the lower hull of the delays, this takes the likeliest for a rate near the one that is expected:
an edge of the hull, or a line of the expected rate.
"""

from collections import deque
from math import sqrt
from typing import Final

from syncrelay.clock.hull import OUTLIERS, Hull, Point

# A point stands for so many seconds, and the lowest of them is kept; where these are too many, the oldest are joined.
_WIDTH: Final = 0.25
_MOST: Final = 192
_LONGEST: Final = 1500.0
# As fast does the rate of an oscillator change as it warms up or cools down, per second. What that may have moved by
# more than this share of the jitter, or this many seconds, is too old for a line.
_WANDER: Final = 0.02e-6
_SHARE_OF_JITTER: Final = 0.05
_LEAST_MOVED: Final = 1e-4
LEAST_JITTER: Final = 2e-5
"""What takes less is below what systems tell of times."""
# Oscillators are mostly within so much of true time. One that was watched for so long keeps its rate within so much.
_USUAL_RATE: Final = 100e-6
_KNOWN_AFTER: Final = 20.0
_SAME_RATE: Final = 5e-6
MOST_RATE: Final = 1500e-6
"""Oscillators are within some 100 ppm, bad ones within 1,000. What is farther off does not drift: it has another rate,
as simulated time may, and is not followed."""


class Envelope:
    """The line under points of one clock that was not set. All times in seconds, x by the clock, y the delays."""

    __slots__ = ("_count", "_expected", "_lowest", "_points", "_scale", "_until", "bounds", "level", "rate")

    def __init__(self, rate: float = 0.0, scale: float = _USUAL_RATE) -> None:
        """Expect a rate, within so much: it is the scale of a Laplace distribution."""
        self.level = 0.0
        """The line's delay at 0."""
        self.rate = rate
        """The line's slope: how fast the delays grow."""
        self.bounds = (-MOST_RATE, MOST_RATE)
        """Between which rates the true one is likely to be."""
        self._expected, self._scale = rate, scale
        self._points: deque[Point] = deque()
        self._lowest = (0.0, 0.0)
        self._count = 0
        self._until = _WIDTH

    def anew(self) -> "Envelope":
        """Return the line of the same oscillator after its clock was set."""
        lowest, highest = self.bounds
        if self._until > _KNOWN_AFTER and highest - lowest < _USUAL_RATE:
            return Envelope(self.rate, _SAME_RATE)
        return Envelope(self._expected, self._scale)

    def height(self, x: float, y: float) -> float:
        """Return how far a point lies above the line."""
        return y - self.level - self.rate * x

    def add(self, x: float, y: float, jitter: float) -> None:
        """Take a point, and how far points usually lie above the line."""
        if x >= self._until and self._count:
            self._points.append((*self._lowest, self._count))
            self._count, self._until = 0, x + _WIDTH
            self._fit(x, max(jitter, LEAST_JITTER))
        # Of so few points none is taken for an outlier: the line falls at once, as it does in the first seconds.
        if len(self._points) * OUTLIERS < 1:
            self.level += min(0.0, self.height(x, y))
        self._count += 1
        if self._count == 1 or y - self.rate * x < self._lowest[1] - self.rate * self._lowest[0]:
            self._lowest = x, y

    def _fit(self, now: float, jitter: float) -> None:
        if len(self._points) > _MOST:
            self._join_oldest()
        while self._points and self._points[0][0] < now - _LONGEST:
            self._points.popleft()
        oldest = now - sqrt(2 * max(_SHARE_OF_JITTER * jitter, _LEAST_MOVED) / _WANDER)
        points = [point for point in self._points if point[0] >= oldest]
        if not points:
            # The device was away for so long that its clock is known by its rate alone.
            return
        hull = Hull(points, self.rate)
        # The likeliest line touches the hull under the mean of all points; for a rate that is less expected, so many
        # seconds farther on either side. In between, the expected rate is as good as any.
        doubt = jitter / (self._scale * hull.count)
        self.bounds = _kept(hull.slope(hull.mean - doubt, -MOST_RATE)), _kept(hull.slope(hull.mean + doubt, MOST_RATE))
        self.rate = min(max(self._expected, self.bounds[0]), self.bounds[1])
        self.level = hull.level(self.rate)

    def _join_oldest(self) -> None:
        points, half = list(self._points), _MOST // 2
        joined = []
        for one, other in zip(points[:half:2], points[1:half:2], strict=True):
            low = min(one, other, key=lambda point: point[1] - self.rate * point[0])
            joined.append((low[0], low[1], one[2] + other[2]))
        self._points = deque(joined + points[half:])


def _kept(rate: float) -> float:
    """Keep a rate within what an oscillator can have."""
    return min(max(rate, -MOST_RATE), MOST_RATE)
