"""A recording through the relay, and what the engine makes of the same messages without ROS."""

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence

from syncrelay.sync import Match, Message, Policy, SyncGroup
from tests.ros.cdr_messages import NS_PER_SECOND, padded, stamp_of, stamps_of, with_stamp
from tests.ros.frames import Frame
from tests.ros.processes import Process, wait_until
from tests.ros.stage import Collector, Player, Stage

# Further from the recording than any slop: the sets that open and close a run take none of its messages.
_APART = 1000 * NS_PER_SECOND


def topics_of(recording: Iterable[Frame]) -> dict[str, str]:
    """The topics of a recording with their types."""
    return {frame.topic: frame.type_name for frame in recording}


def connect(player: Player, collector: Collector, recording: Sequence[Frame], outputs: Iterable[str]) -> int:
    """Send sets of equal stamps, older than the recording, until one has come out of every output.

    Returns how many it sent. How many of them come out depends on the machine.
    """
    first = min(stamp_of(frame.payload) for frame in recording) - _APART
    stamps = itertools.count(first, NS_PER_SECOND)
    play_until_out(player, collector, (a_set(recording, stamp) for stamp in stamps), outputs)
    return (next(stamps) - first) // NS_PER_SECOND


def play_until_out(player: Player, collector: Collector, sets: Iterator[list[Frame]], outputs: Iterable[str]) -> None:
    """Play one set after the other until there is a message on every output.

    A subscription that is seen in the graph may still miss what its publisher sends at that moment. A message
    that came through proves the whole way.
    """
    player.match()

    def out() -> bool:
        if all(collector.count(output) for output in outputs):
            return True
        player.play(next(sets))
        return False

    wait_until(out, f"a set on {', '.join(outputs)}")


def conclude(player: Player, collector: Collector, recording: Sequence[Frame], outputs: Iterable[str]) -> None:
    """Send a set of equal stamps, newer than the recording, and wait until it has come out of every output.

    Messages of a topic keep their order on the way: behind this set there is nothing more of the recording.
    """
    last = closing_stamp(recording)

    def concluded() -> list[int]:
        return [stamps_of(collector.payloads(output)).count(last) for output in outputs]

    due = [count + 1 for count in concluded()]
    player.play(a_set(recording, last))
    collector.process.wait_until(lambda: concluded() == due, "the set that concludes the recording")


def closing_stamp(recording: Sequence[Frame]) -> int:
    return max(stamp_of(frame.payload) for frame in recording) + _APART


def a_set(recording: Sequence[Frame], stamp: int) -> list[Frame]:
    """A message of each topic of the recording, all with one stamp."""
    one_each = {frame.topic: frame for frame in recording}.values()
    return [frame._replace(time=0, payload=with_stamp(frame.payload, stamp)) for frame in one_each]


def within(recording: Sequence[Frame], payloads: Iterable[bytes]) -> list[bytes]:
    """Those payloads whose stamps lie in the recording's time, so neither the first sets' nor the last's."""
    stamps = [stamp_of(frame.payload) for frame in recording]
    begin, end = min(stamps), max(stamps)
    return [payload for payload in payloads if begin <= stamp_of(payload) <= end]


def matched_by_engine(policy: Policy, recording: Sequence[Frame], topics: Sequence[str]) -> list[tuple[bytes, ...]]:
    """The sets that the engine gives when it is fed the messages in the order of the recording."""
    group = SyncGroup(policy, required=(True,) * len(topics), max_wait_ns=None)
    outcomes = [
        outcome
        for frame in recording
        if frame.topic in topics
        for outcome in group.add(
            Message(topics.index(frame.topic), stamp_of(frame.payload), frame.payload), now=frame.time
        )
    ]
    return [
        tuple(message.payload for message in outcome.messages if message is not None)
        for outcome in outcomes
        if isinstance(outcome, Match)
    ]


def relay(
    stage: Stage,
    text: str,
    recording: Sequence[Frame],
    aligned: Mapping[str, str],
    *,
    speed: float = 10,
    arguments: Sequence[str] = (),
) -> tuple[Process, Collector]:
    """Play a recording through the relay on a file of this text: the relay, still running, and what came out.

    `aligned` are the outputs with their types.
    """
    collector = stage.collector(aligned)
    relay_process = stage.relay(text, *arguments)
    player = stage.player(topics_of(recording))
    connect(player, collector, recording, aligned)
    player.play(recording, speed=speed)
    conclude(player, collector, recording, aligned)
    return relay_process, collector


def expected_sets(policy: Policy, recording: Sequence[Frame], topics: Sequence[str]) -> list[tuple[bytes, ...]]:
    """The sets that come out of `relay`: those of the engine when it gets the recording and the closing set.

    The closing set ends the wait of the last sets for something closer, which the recording leaves open.
    """
    closing = a_set(recording, closing_stamp(recording))
    sets = matched_by_engine(policy, [*recording, *closing], topics)[:-1]
    return [tuple(map(padded, one)) for one in sets]


def sets_within(recording: Sequence[Frame], collector: Collector, aligned: Iterable[str]) -> list[tuple[bytes, ...]]:
    """The sets that came out of `relay`, without those that open and close it.

    Outputs of unequal length are refused.
    """
    received = [map(padded, within(recording, collector.payloads(output))) for output in aligned]
    return list(zip(*received, strict=True))
