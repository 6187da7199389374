"""How stamps of devices were mapped to the host's time: the figures of each such input, and what is drawn of it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from syncrelay.clock import Step
from syncrelay.config import GroupConfig
from syncrelay.config.wording import counted
from syncrelay.explain import UNREADABLE, words
from syncrelay.explain.nearest import shifted
from syncrelay.recordings.analysis.streams import Stream
from syncrelay.recordings.bag.columns import Nanoseconds

# So many messages of an input are drawn.
_MOST_DRAWN: Final = 4_000


@dataclass(frozen=True, slots=True)
class MappedInput:
    """One input, in nanoseconds.

    `offset` is how far its stamps were behind the host's time at last, the least delay that its messages have included;
    `rate_ppm` how much slower than the host's its clock ran then. `restarts` says when it was set, and by how much
    forward; `delay` is what was taken off.
    """

    topic: str
    offset: int
    rate_ppm: float
    restarts: tuple[Step, ...]
    delay: int

    def __str__(self) -> str:
        """Say it in a line."""
        pace = f"runs {words.figure(abs(self.rate_ppm))} ppm {'slow' if self.rate_ppm > 0 else 'fast'}"
        apart = f"{words.span_of_time(abs(self.offset))} {'behind' if self.offset > 0 else 'ahead'}"
        line = f"{self.topic} is mapped to the host's time: its clock {pace}, {apart}"
        if self.restarts:
            by = self.restarts[-1].by
            way = f"{'forward' if by > 0 else 'back'} by {words.span_of_time(abs(by))}"
            line += f"; set {counted(len(self.restarts), 'time')}, {'last ' if len(self.restarts) > 1 else ''}{way}"
        return f"{line}; {words.duration(self.delay) if self.delay else 'nothing'} of its least delay taken off"


@dataclass(frozen=True, slots=True)
class MappingCurve:
    """Stamps minus times of receipt, and minus what they were mapped to, in nanoseconds.

    `times` are those of receipt. Between two settings of the clock, 0 is where the line is in the middle: what the
    clocks are apart is not drawn. `begins` are the places after each setting.
    """

    times: Nanoseconds
    stamps: Nanoseconds
    line: Nanoseconds
    begins: tuple[int, ...]


def mapped_inputs(group: GroupConfig, streams: Sequence[Stream]) -> Iterator[tuple[MappedInput, MappingCurve]]:
    """Yield the inputs of a group whose stamps were mapped."""
    for topic, stream in zip(group.topics, streams, strict=True):
        mapping = stream.mapping
        if mapping is None or not len(mapping.stamps):
            continue
        mapped, received, _ = stream.arrays()
        came = mapping.stamps[:]
        is_set = (came != 0) & (came != UNREADABLE)
        came, mapped, received = came[is_set], mapped[is_set] + mapping.delay_ns, received[is_set]
        if not len(came):
            continue
        found = MappedInput(
            topic.topic, int(mapped[-1]) - int(came[-1]), mapping.rate * 1e6, mapping.steps, mapping.delay_ns
        )
        yield found, _curve(came, mapped, received, mapping.steps)


def _curve(came: Nanoseconds, mapped: Nanoseconds, received: Nanoseconds, steps: Sequence[Step]) -> MappingCurve:
    line, stamps = shifted(came, 0) - mapped, shifted(came, 0) - received
    begins = np.searchsorted(received, np.array([step.at for step in steps], dtype=np.int64))
    for epoch in np.split(np.arange(len(came)), begins):
        if len(epoch):
            middle = int(np.quantile(line[epoch], 0.5, method="inverted_cdf"))
            line[epoch], stamps[epoch] = line[epoch] - middle, stamps[epoch] - middle
    each = -(-len(came) // _MOST_DRAWN)
    return MappingCurve(received[::each], stamps[::each], line[::each], tuple((-(-begins // each)).tolist()))
