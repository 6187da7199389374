"""Stamps that are read in one go are those that are read one by one."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.cdr import read_stamp
from syncrelay.config import load_text
from syncrelay.dataflow.group import GroupRelay
from syncrelay.explain import UNREADABLE
from syncrelay.recordings.bag import Channel, Encoding
from syncrelay.recordings.bag.columns import Batch, Columns, cdr_stamps, column_reader, ros1_stamps
from syncrelay.recordings.bag.payloads import read_ros1_stamp
from syncrelay.recordings.bag.recording import filled
from tests.ros.cdr_messages import vector

_SECOND = 1_000_000_000
_VECTOR = "geometry_msgs/msg/Vector3Stamped"
_EDGES = [0, 1, _SECOND - 1, _SECOND, 2**31 - 1, 2**31, 2**32 - 1]
_NUMBER = st.sampled_from(_EDGES) | st.integers(0, 2**32 - 1)
_KINDS = [bytes([first, second]) for first in (0, 1) for second in (0, 1, 2, 6, 7, 255)]


@st.composite
def _payloads(draw):
    order = draw(st.sampled_from(["little", "big"]))
    fields = b"".join(draw(_NUMBER).to_bytes(4, order) for _ in range(2))
    return (draw(st.sampled_from(_KINDS)) + b"\0\0" + fields + b"more")[: draw(st.sampled_from([0, 3, 11, 12, 16]))]


@pytest.mark.parametrize(("all_at_once", "one"), [(cdr_stamps, read_stamp), (ros1_stamps, read_ros1_stamp)])
@given(payloads=st.lists(_payloads(), min_size=1))
def test_stamps_of_all_payloads_are_those_of_each(all_at_once, one, payloads):
    channel = Channel(0, "/a", "a/msg/A", Encoding.CDR)
    heads = Batch([(channel, 0, payload) for payload in payloads]).heads
    expected = [one(payload) for payload in payloads]
    assert all_at_once(heads).tolist() == [UNREADABLE if stamp is None else stamp for stamp in expected]


@given(sizes=st.lists(st.integers(0, 5000), max_size=8), large=st.booleans())
def test_batches_that_are_filled_hold_the_same_messages_and_none_is_empty(sizes, large):
    payload = b"a" * (1_000_000 if large else 1)
    channel = Channel(0, "/a", "a/msg/A", Encoding.CDR)
    messages = [(channel, number, payload) for number in range(sum(sizes))]
    ends = [sum(sizes[: place + 1]) for place in range(len(sizes))]
    batches = list(filled(messages[end - size : end] for size, end in zip(sizes, ends, strict=True)))
    assert [message for batch in batches for message in batch] == messages
    assert all(batches)
    assert len(batches) <= len([size for size in sizes if size])


@pytest.mark.parametrize(("size", "expected"), [(1, [2000, 2000, 500]), (1_000_000, [4, 4, 2])])
def test_a_batch_is_full_with_2000_messages_or_4_mb(size, expected):
    message = (Channel(0, "/a", "a/msg/A", Encoding.CDR), 0, bytes(size))
    assert [len(batch) for batch in filled([message] for _ in range(sum(expected)))] == expected


def test_stamps_of_a_device_are_mapped_as_they_are_live(caplog):
    topics = [{"topic": "/a", "type": _VECTOR, "clock": "device", "delay": "8ms"}, {"topic": "/b", "type": _VECTOR}]
    group = {"policy": "approximate_time", "slop": "20ms", "topics": topics}
    relay = GroupRelay(load_text(json.dumps({"version": 1, "groups": {"front": group}})).groups[0], now=lambda: 0)
    # Of two recorders, or of one that began again.
    channels = [Channel(number, "/a", _VECTOR, Encoding.CDR) for number in range(2)]
    # Every 50 ms by a clock that began an hour ago; it begins anew after a minute.
    came = [(number * 50_000_000, number % 7 * 1_000_000) for number in range(2000)]
    rows = [
        (channels[number % 2], at + late + 10**18, vector(at + (3600 * _SECOND if number < 1200 else 0), frame_id="a"))
        for number, (at, late) in enumerate(came)
    ]
    rows.append((channels[0], 2 * 10**18, b"\0\1\0\0"))
    readers = [(each, column_reader(relay.config, 0, each)) for each in channels]
    columns = Columns([readers], [relay.config.topics[0].device_clock()])
    recorded = [stamp for part in (rows[:700], rows[700:]) for _, _, stamp, _ in columns.in_order(Batch(part))]
    clock = relay.clocks[0]
    assert clock is not None
    assert relay.clocks[1] is None
    live = [clock.host_time(stamp, at) for _, at, data in rows[:-1] if (stamp := read_stamp(data)) is not None]
    assert recorded == [*live, UNREADABLE]
    assert all(abs(host - at - 10**18 + 8_000_000) < 7_000_000 for host, (at, _) in zip(live, came, strict=True))
    (record,) = caplog.records
    assert record.getMessage() == (
        "front: stamps of /a jumped back by 60 min against this machine's clock, and are mapped anew from here:"
        " one of the two clocks was set, or the device started again"
    )
