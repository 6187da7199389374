"""Stamps that are read in one go are those that are read one by one."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.cdr import read_stamp
from syncrelay.explain import UNREADABLE
from syncrelay.recordings.bag import Channel, Encoding
from syncrelay.recordings.bag.columns import Batch, cdr_stamps, ros1_stamps
from syncrelay.recordings.bag.payloads import read_ros1_stamp
from syncrelay.recordings.bag.recording import filled

_SECOND = 1_000_000_000
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
