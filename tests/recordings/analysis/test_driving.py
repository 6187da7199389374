"""A replay and an evaluation of one recording give the same sets and drops, at the same times."""

from collections.abc import Collection, Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.config import load_text
from syncrelay.recordings.analysis import analyze
from syncrelay.recordings.analysis.evaluation import DropOut, evaluate
from syncrelay.recordings.analysis.html import as_html
from syncrelay.recordings.analysis.report_json import as_json
from syncrelay.recordings.analysis.report_text import report
from syncrelay.recordings.analysis.streams import read_streams
from syncrelay.recordings.analysis.watching import watch_group
from syncrelay.recordings.bag import Channel, Encoding
from syncrelay.recordings.bag.bindings import bind
from syncrelay.recordings.bag.payloads import message_reader
from syncrelay.recordings.bag.recording import Definition, RawMessage
from syncrelay.recordings.bag.replay import replay
from syncrelay.sync import DropReason, Match, Message, Outcome
from tests.recordings.bag.reading import one_by_one
from tests.ros.cdr_messages import STORE, VECTOR, vector
from tests.ros.configs import config, inputs
from tests.ros.streams import MS

_TOPICS = ("/a", "/b", "/c")
_SECOND = 1000 * MS
_CENTURIES = (0, 1, 5 * _SECOND, 946_684_800 * _SECOND, 1_700_000_000 * _SECOND, (2**31 - 2) * _SECOND)
_DEFINITION = Definition("ros2msg", STORE.generate_msgdef(VECTOR, ros_version=2)[0])


_BATCH = 7


class Made:
    """A recording in memory, of rows: a topic's index, a stamp or None, a time of receipt, a frame_id."""

    def __init__(self, rows) -> None:
        self.channels = tuple(
            Channel(index, topic, VECTOR, Encoding.CDR, _DEFINITION) for index, topic in enumerate(_TOPICS)
        )
        self.rows = rows
        self.begin = rows[0][2] if rows else 0
        self.end = rows[-1][2] if rows else 0
        self.faults: list[str] = []
        self.size = self.position = 0

    def batches(self, channels: Collection[Channel]) -> Iterator[list[RawMessage]]:
        """Give the rows of some channels in the order of receipt, and a batch of none."""
        for first in range(0, len(self.rows) + _BATCH, _BATCH):
            yield list(self._messages(channels, self.rows[first : first + _BATCH]))

    def _messages(self, channels: Collection[Channel], rows) -> Iterator[RawMessage]:
        for row in rows:
            if self.channels[row[0]] in channels:
                yield self.message(*row)

    def message(self, index, stamp, received, frame_id) -> RawMessage:
        """Give one row as it was recorded."""
        payload = b"\0\1\0\0" if stamp is None else vector(stamp, frame_id=frame_id)
        return self.channels[index], received, payload

    def close(self) -> None:
        """Close nothing."""


_POLICIES = {
    "exact_time": {},
    "approximate_time": {"slop": "20ms"},
    "approximate_time_eager": {"slop": "20ms"},
    "approximate_epsilon_time": {"slop": "20ms"},
    "latest_time": {"trigger": "/a", "max_age": "50ms"},
    "latest_time by a clock": {"trigger": "29.97 Hz", "max_age": "50ms", "max_wait": "60ms"},
    "equal_key": {"key": "header.frame_id"},
}


@st.composite
def _recordings(draw):
    """Rows in the order of receipt, of any century, some late, out of order, unset, repeated or unreadable."""
    begin, now = draw(st.sampled_from(_CENTURIES)), 0
    rows = []
    for index, step, delay, kind in draw(
        st.lists(st.tuples(st.integers(0, 2), st.integers(0, 60), st.integers(0, 40), st.integers(0, 30)), max_size=40)
    ):
        now += step * MS
        stamp: int | None = max(0, begin + now - delay * MS)
        stamp = {0: 0, 1: None, 2: max(0, begin + now - 3 * _SECOND)}.get(kind, stamp)
        rows.append((index, stamp, begin + now, f"frame_{kind % 5}"))
    return Made(rows)


@st.composite
def _groups(draw, policy):
    topics = inputs(dict.fromkeys(_TOPICS, VECTOR))
    keys = {"policy": policy.partition(" ")[0], "topics": topics, **_POLICIES[policy]}
    is_by_clock = "max_wait" in keys
    # While a tick is waited for, up to 4 messages of an input come.
    keys["queue_size"] = draw(st.integers(4, 8) if is_by_clock else st.integers(1, 5))
    keys["restamp"] = draw(st.sampled_from(["none", "earliest", "latest", "trigger" if is_by_clock else "/b"]))
    keys["every"] = draw(st.integers(1, 3))
    if draw(st.booleans()):
        keys["max_rate"] = "10 Hz"
    if not policy.startswith("latest_time") and draw(st.booleans()):
        keys["max_wait"] = f"{draw(st.integers(0, 100))}ms"
        topics[2]["required"] = draw(st.booleans())
    if policy != "equal_key":
        topics[1]["offset"] = f"{draw(st.integers(-30, 30))}ms"
    if policy != "exact_time" and draw(st.booleans()):
        topics[1]["stamp"] = "receive"
    return config({"front": keys})


def _replayed(recording, bindings):
    sets, drops = [], []

    def listen(_, outcome, now):
        if isinstance(outcome, Match):
            sets.append((outcome.stamps, now))
        else:
            message = outcome.message
            drops.append(DropOut(message.input, message.stamp, message.payload[1], outcome.reason))

    (result,) = replay(recording, bindings, listeners=[one_by_one(listen)])
    return sets, drops, [each.counts for each in result.inputs]


def _fed_one_by_one(recording, binding):
    """What an engine makes of the messages, each read by itself and fed at its time: sets, drops, counts."""
    engine = binding.group.engine()
    left: list[tuple[Outcome, int | None]] = []

    def expire(until):
        while (deadline := engine.next_deadline()) is not None and (until is None or deadline <= until):
            left.extend((each, deadline) for each in engine.expire(now=deadline))

    # A clock goes on without an end: its last tick is that of the last message.
    last = None if binding.group.ticks is None else recording.end + binding.group.options.max_wait

    for index, stamp, received, frame_id in recording.rows:
        raw = recording.message(index, stamp, received, frame_id)
        stamp_read, key = message_reader(binding.group, index, raw[0])(raw)
        expire(received)
        if stamp_read is None:
            outcomes = [engine.reject(Message(index, 0, raw), DropReason.MALFORMED)]
        else:
            outcomes = engine.add(Message(index, stamp_read, raw, key), now=received)
        left += [(each, received) for each in outcomes]
    expire(last)
    left += [(each, None) for each in engine.flush(DropReason.SHUTDOWN)]
    sets = [(each.stamps, now) for each, now in left if isinstance(each, Match)]
    drops = [each for each, _ in left if not isinstance(each, Match)]
    told = [DropOut(each.message.input, each.message.stamp, each.message.payload[1], each.reason) for each in drops]
    return sets, told, list(engine.counts())


@pytest.mark.parametrize("policy", _POLICIES)
@given(data=st.data())
def test_a_replay_and_an_evaluation_give_what_messages_fed_one_by_one_give(policy, data):
    recording, text = data.draw(_recordings()), data.draw(_groups(policy))
    bindings = bind(load_text(text), recording)
    sets, drops, counts = _replayed(recording, bindings)
    assert (sets, drops, counts) == _fed_one_by_one(recording, bindings[0])
    assert [each.counts for each in replay(recording, bindings)[0].inputs] == counts
    (streams,) = read_streams(recording, bindings)
    evaluation = evaluate(bindings[0].group, streams)
    assert [(each.stamps, each.left) for each in evaluation.sets] == sets
    assert list(evaluation.drops) == drops
    assert list(evaluation.counts) == counts
    for index, each in enumerate(counts):
        assert each.fed == each.matched + sum(each.dropped.values()) + each.buffered
        assert each.fed == sum(row[0] == index for row in recording.rows)
        assert each.buffered == 0
    assert all(each.seconds > 0 for each in watch_group(bindings[0].group, streams, evaluation))


@given(recording=_recordings(), text=st.sampled_from([*_POLICIES]).flatmap(_groups))
@pytest.mark.long
def test_every_view_of_an_analysis_counts_alike_whatever_was_recorded(recording, text):
    analysis = analyze(recording, text, bind(load_text(text), recording))
    (group,) = as_json("made", analysis)["groups"]
    lines, page = list(report("made", analysis)), as_html("made", analysis)
    for topic, each in zip(_TOPICS, group["inputs"], strict=True):
        dropped = sum(each["dropped"].values())
        assert each["received"] == each["matched"] + dropped >= each["matched"] + each["unneeded"]
        assert f"  {topic}: {each['received']} received, {each['matched']} in sets" in "\n".join(lines)
        assert f"<code>{topic}</code> {each['received']} received" in page
    by_value = {point["queue_size"]: point["sets"] for point in group["by_queue_size"]}
    if by_value:
        assert max(by_value.values()) <= group["suggestion"]["possible"]
        if not group["suggestion"]["changes"]:
            queue_size = load_text(text).groups[0].options.queue_size
            assert by_value[queue_size] == group["suggestion"]["now"]
