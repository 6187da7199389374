"""A recording with faults laid over it: what would have been recorded with these faults."""

import heapq
from collections.abc import Collection, Iterator, Sequence
from itertools import count
from typing import Final

from syncrelay.cdr import LATEST_STAMP, patch_stamp, read_stamp
from syncrelay.errors import UsageError
from syncrelay.recordings.bag.definitions import begins_with_header
from syncrelay.recordings.bag.payloads import read_ros1_stamp, with_ros1_stamp
from syncrelay.recordings.bag.recording import LATEST, Channel, Encoding, RawMessage, Recording, filled
from syncrelay.rig.what_if import MOST_LATE, Disturbance, Fault, disturbances


class Disturbed:
    """What would have been recorded with faults; see Recording.

    Raises UsageError for a fault of a topic that the recording lacks, and for a clock that stamps nothing: a type
    without a Header.
    """

    def __init__(self, recording: Recording, faults: Sequence[Fault], *, seed: int) -> None:
        """The same recording, faults and seed give the same messages."""
        topics = list(dict.fromkeys(channel.topic for channel in recording.channels))
        try:
            self._disturbances = disturbances(faults, topics, seed=seed, began=recording.begin)
        except ValueError as error:
            raise UsageError(str(error)) from error
        self._recording: Final = recording
        for channel in recording.channels:
            disturbance = self._disturbances.get(channel.topic)
            if disturbance is not None and disturbance.changes_stamps and not begins_with_header(channel):
                raise UsageError(
                    f"{channel.topic}: {channel.type} does not begin with a std_msgs/msg/Header, so it has no stamp"
                    " that a clock could have set: `offset` and `drift` are for stamped topics"
                )
        self._most_late = max((each.most_late for each in self._disturbances.values()), default=0)
        if self._most_late > MOST_LATE:
            raise UsageError(
                f"messages would be late by {self._most_late / 1e9:g}s in all, expected 60s at most, because they are"
                " held in memory for that long"
            )
        self.channels: Final = recording.channels
        self.size: Final = recording.size
        self.begin: Final = recording.begin
        self.end: Final = min(recording.end + self._most_late, LATEST)

    @property
    def faults(self) -> list[str]:
        """See Recording."""
        return self._recording.faults

    def idle(self) -> list[str]:
        """Return a sentence for each fault that has not changed any message so far."""
        return [sentence for each in self._disturbances.values() for sentence in each.idle()]

    @property
    def position(self) -> int:
        """See Recording."""
        return self._recording.position

    def batches(self, wanted: Collection[Channel]) -> Iterator[list[RawMessage]]:
        """See Recording."""
        return filled(self._in_order(wanted))

    def _in_order(self, wanted: Collection[Channel]) -> Iterator[list[RawMessage]]:
        """Yield a message once no earlier one can follow; late ones wait until then."""
        waiting: list[tuple[int, int, RawMessage]] = []
        numbers = count()
        for batch in self._recording.batches(wanted):
            for raw in batch:
                disturbed = self._disturbed(raw)
                if disturbed is not None:
                    heapq.heappush(waiting, (disturbed[1], next(numbers), disturbed))
            ready: list[RawMessage] = []
            while waiting and batch and waiting[0][0] <= batch[-1][1]:
                ready.append(heapq.heappop(waiting)[2])
            yield ready
        yield [heapq.heappop(waiting)[2] for _ in range(len(waiting))]

    def _disturbed(self, raw: RawMessage) -> RawMessage | None:
        channel, received, payload = raw
        disturbance = self._disturbances.get(channel.topic)
        if disturbance is None:
            return raw
        later = disturbance.received(received)
        if later is None:
            return None
        return channel, min(later, LATEST), _restamped(payload, channel, disturbance, received)

    def close(self) -> None:
        """See Recording."""
        self._recording.close()


def _restamped(payload: bytes, channel: Channel, disturbance: Disturbance, received: int) -> bytes:
    """Return a payload with the stamp that the faulty clock would have set; without a stamp, return it unchanged."""
    if not disturbance.changes_stamps:
        return payload
    is_ros1 = channel.encoding is Encoding.ROS1
    stamp = read_ros1_stamp(payload) if is_ros1 else read_stamp(payload)
    if stamp is None:
        return payload
    shifted = max(0, min(disturbance.stamp(stamp, received), LATEST_STAMP))
    return with_ros1_stamp(payload, shifted) if is_ros1 else patch_stamp(payload, shifted)
