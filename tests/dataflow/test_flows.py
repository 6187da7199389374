"""The compiled flow does what the one in Python does: the same messages leave, and the same is noted of them."""

from importlib import import_module
from importlib.util import find_spec

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from syncrelay.cdr import read_stamp
from syncrelay.dataflow.backend import PublishError
from tests.dataflow.payloads import FLOWS, Named, Outlet, group_of
from tests.ros.cdr_messages import VECTOR, vector
from tests.ros.streams import BEGIN, MS

pytestmark = pytest.mark.skipif(
    find_spec("syncrelay.ros.compiled.path") is None, reason="the compiled path was not built"
)

_TOPICS = ("/camera", "/lidar", "/imu")
_KEYED = [{"topic": topic, "type": VECTOR, "key": "vector.x"} for topic in _TOPICS]
_KINDS = [
    {"policy": "exact_time", "queue_size": 3},
    {"policy": "approximate_time", "slop": "20ms", "queue_size": 3, "restamp": "latest"},
    {"policy": "approximate_time_eager", "slop": "20ms", "max_wait": "5ms", "every": 2},
    {"policy": "latest_time", "trigger": "/camera", "max_age": "1s", "restamp": "/lidar"},
    {"policy": "equal_key", "queue_size": 3, "topics": _KEYED},
]
_STREAMS = st.lists(
    st.tuples(st.integers(0, 2), st.one_of(st.none(), st.integers(-30, 30)), st.booleans()), max_size=60
)


def _played(flow, keys, stream, connected) -> list:
    """All that can be seen of a group of this flow."""
    seen = [0]
    group = group_of(**{"topics": _TOPICS, **keys}, now=lambda: seen[0], flow=flow)
    noted: list[object] = []
    outlets = [Outlet(log=noted, place=index) for index in range(3)]
    for index in connected:
        group.connect(index, outlets[index], restamped=index != 1)
    group.flow.tell = lambda flow, match, _: noted.append(("told", flow.n_sets, match.stamps, match.stamp))
    for count, (index, ahead, refuses) in enumerate(stream):
        seen[0], outlets[index].refusal = count * MS, PublishError("no room") if refuses else None
        stamp = None if ahead is None else BEGIN + (10 * count + ahead) * MS
        group.flow.receive(
            index, Named(count, BEGIN + count), stamp, count // 4 if keys["policy"] == "equal_key" else None
        )
        noted.append((group.flow.n_sets, dict(group.unpublished), list(group.flow.keys)))
        if count % 20 == 19:
            watched = group.flow.watched()
            noted.append((*map(list, watched.arrivals), [stamps for stamps, _ in watched.sets]))
    return [noted, list(group.flow.last), group.counts(), group.failure]


@given(keys=st.sampled_from(_KINDS), stream=_STREAMS, connected=st.sets(st.integers(0, 2)))
def test_the_same_leaves_and_the_same_is_noted(keys, stream, connected):
    first, second = (_played(flow, keys, stream, connected) for flow in FLOWS)
    assert first == second


@given(st.binary(max_size=16))
@example(vector(-1))
@example(vector(2**31 * 10**9 - 1, little_endian=False))
@example(b"\x00\x07\x00\x00\x01\x00\x00\x00\xff\xc9\x9a\x3b")
@example(b"\x00\x06\x00\x00\x80\x00\x00\x00\x3b\x9a\xca\x00")
def test_the_same_stamp_is_read(content):
    assert import_module("syncrelay.ros.compiled.path").stamp_of(content) == read_stamp(content)
