"""The librcl backend from within: whose memory a message is, and what of it Python gets to see."""

import ctypes
import gc
import math
import threading
import time
import tracemalloc
from collections.abc import Iterator
from types import SimpleNamespace

import pytest

from syncrelay.config import load
from syncrelay.dataflow.backend import ALL, BackendName, PublishError
from syncrelay.dataflow.bugs import Bugs
from syncrelay.dataflow.group import GroupRelay
from syncrelay.dataflow.manifest import ManifestWriter
from syncrelay.dataflow.manifest_queue import ManifestQueue
from syncrelay.errors import RosUnavailableError, UsageError
from syncrelay.sync import DropReason
from tests.ros.cdr_messages import VECTOR, padded, stamp_of, vector, with_stamp
from tests.ros.configs import config, inputs
from tests.ros.processes import wait_until
from tests.ros.streams import BEGIN, MS

rclpy = pytest.importorskip("rclpy", reason="rclpy is not installed")
qos = pytest.importorskip("rclpy.qos")
Vector3Stamped = pytest.importorskip("geometry_msgs.msg").Vector3Stamped
check = pytest.importorskip("syncrelay.ros.librcl.check")
LibrclBackend = pytest.importorskip("syncrelay.ros.librcl.backend").LibrclBackend
messages = pytest.importorskip("syncrelay.ros.librcl.messages")
rcl = pytest.importorskip("syncrelay.ros.librcl.rcl")
buffers = pytest.importorskip("syncrelay.ros.librcl.buffers")
RclpyBackend = pytest.importorskip("syncrelay.ros.rclpy_backend").RclpyBackend
choose_backend = pytest.importorskip("syncrelay.ros.backend_choice").choose_backend
handler = pytest.importorskip("syncrelay.ros.handlers").handler

pytestmark = pytest.mark.ros

_KEEP_ALL = qos.QoSProfile(history=qos.HistoryPolicy.KEEP_ALL)
_IMAGE_BYTES = 1_000_000
_LONG_NS = 60_000_000_000
_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}


@pytest.fixture
def here(ros_domain: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[SimpleNamespace]:
    """A node of this process, and the librcl backend as it proved itself on it."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

    context = rclpy.context.Context()
    rclpy.init(context=context, domain_id=ros_domain, args=["--ros-args", "--disable-external-lib-logs"])
    node = rclpy.create_node("here", context=context)
    try:
        yield SimpleNamespace(node=node, context=context, backend=check.checked_backend(node), rcl=rcl.Rcl())
    finally:
        node.destroy_node()
        context.try_shutdown()


@pytest.fixture
def topic(here) -> Iterator[SimpleNamespace]:
    """A topic with a subscription and a publisher that keep all."""

    subscription = here.node.create_subscription(Vector3Stamped, "/t", print, _KEEP_ALL, raw=True)
    publisher = here.node.create_publisher(Vector3Stamped, "/t", _KEEP_ALL)
    yield SimpleNamespace(subscription=subscription, publisher=publisher)
    here.node.destroy_subscription(subscription)
    here.node.destroy_publisher(publisher)


def _group(tmp_path, **keys):
    path = tmp_path / "group.yaml"
    path.write_text(config({"front": {"policy": "exact_time", "topics": inputs(_PAIR), **keys}}))
    return GroupRelay(load(str(path)).groups[0], now=lambda: 0)


def _source(here, topic, deliver, pool=None):
    return messages.LibrclSource(here.rcl, pool or buffers.Pool(here.rcl), topic.subscription, deliver)


def _take(source):
    """Its oldest message, whether anybody told it or not."""
    source.pending = ALL
    return source.take()


def _told(source):
    """Its oldest message, of those that it was told of."""
    return source.take() if source.pending else None


def test_a_message_comes_out_as_it_went_in(here, topic):
    source = here.backend.source(topic.subscription, print)
    payload = vector(BEGIN, frame_id="a frame")
    topic.publisher.publish(payload)
    taken = _take(source)
    assert bytes(taken.content()) == padded(payload)
    assert taken.received > BEGIN
    assert _take(source) is None


def test_every_memory_comes_back_once_whatever_became_of_its_message(here, topic, tmp_path):
    # One topic feeds both inputs of two groups: each message has up to four owners at a time.
    pool, most = buffers.Pool(here.rcl), 0
    groups = [_group(tmp_path, queue_size=5), _group(tmp_path, queue_size=20)]
    for group in groups:
        for index in range(2):
            group.connect(index, here.backend.outlet(topic.publisher), restamped=True)

    def deliver(payload):
        stamp = stamp_of(bytes(payload.content()))
        for group in groups:
            group.flow.receive(stamp // MS % 2, payload, stamp)

    source = _source(here, topic, deliver, pool)
    for n in range(2000):
        # Even and odd stamps never match, so the queues are always full and most overflow.
        topic.publisher.publish(vector(BEGIN + n * MS))
        payload = _take(source)
        source.deliver(payload)
        most = max(most, pool.lent)
    # Both groups keep twenty of each input at most; one is being delivered and one is for the next message.
    assert most <= 2 * 20 + 2
    del payload
    for group in groups:
        group.flush(DropReason.SHUTDOWN)
    gc.collect()
    assert pool.lent == 1
    assert len({id(memory) for memory in pool.spare}) == len(pool.spare)


def test_a_payload_that_serves_two_sets_keeps_its_own_stamp(here, topic):
    source = _source(here, topic, print)
    outlet = here.backend.outlet(topic.publisher)
    original = padded(vector(BEGIN))
    topic.publisher.publish(original)
    payload = _take(source)
    outlet.send_stamped(payload, BEGIN + 5)
    assert bytes(payload.content()) == original
    outlet.send(payload)
    stamped, unchanged = _take(source), _take(source)
    assert bytes(stamped.content()) == with_stamp(original, BEGIN + 5)
    assert bytes(unchanged.content()) == original
    assert len({payload.memory, stamped.memory, unchanged.memory}) == 3


def test_a_burst_takes_no_more_memory_than_the_queues_and_gives_it_back(here, topic, tmp_path):
    pool, most = buffers.Pool(here.rcl), 0
    group = _group(tmp_path, queue_size=30)
    source = _source(here, topic, lambda *_: None, pool)
    for n in range(500):
        topic.publisher.publish(vector(BEGIN + n * MS))
    while (payload := _take(source)) is not None:
        group.flow.receive(0, payload, stamp_of(bytes(payload.content())))
        most = max(most, pool.lent)
    counts = group.engine.counts()[0]
    assert counts.fed == 500
    assert counts.dropped == {DropReason.OVERFLOW: 470}
    assert most <= 30 + 2
    del payload
    group.flush(DropReason.SHUTDOWN)
    assert pool.made - pool.freed <= 10


def test_a_group_that_ends_gives_its_memory_back_without_the_collector(here, topic, tmp_path):
    pool, group = buffers.Pool(here.rcl), _group(tmp_path, queue_size=30)
    source = _source(here, topic, handler(group, 0, Vector3Stamped), pool)
    group.connect(0, here.backend.outlet(topic.publisher), restamped=False)
    queue = ManifestQueue(bugs=Bugs())
    writer = ManifestWriter(group.config, node="/n", topics=[("/camera", "/a"), ("/lidar", "/b")])
    group.tell_sets(queue.begin("front", writer, here.backend.outlet(topic.publisher)))
    for n in range(20):
        topic.publisher.publish(vector(BEGIN + n * MS))
        source.deliver(_take(source))
    assert pool.lent == 21
    gc.disable()
    try:
        source.deliver = print
        del group
        assert pool.lent == 1
    finally:
        gc.enable()


def test_what_the_collector_ends_in_whatever_order_comes_back_as_new(here, topic):
    pool = buffers.Pool(here.rcl)
    source = _source(here, topic, print, pool)
    # What other tests left is none of the garbage that is looked for here.
    gc.freeze()
    for n in range(50):
        topic.publisher.publish(vector(BEGIN + n * MS))
        payload = _take(source)
        assert bytes(payload.content()) == padded(vector(BEGIN + n * MS))
        # The payload, its memory and what refers to it are garbage at once.
        circle: list[object] = [payload]
        circle.append(circle)
        del payload, circle
        gc.collect()


def test_python_never_holds_the_bytes_of_a_message(here, topic, tmp_path):
    """Nor are they deserialized: behind the stamp there is nothing that any type could be read from."""
    payload = padded(vector(BEGIN)[:12] + b"\xff" * _IMAGE_BYTES)
    stamps = [BEGIN + n * MS for n in range(20)]
    group = _group(tmp_path, restamp="latest")
    kept = _source(here, topic, print)
    for index in range(2):
        group.connect(index, here.backend.outlet(topic.publisher), restamped=True)
    handlers = _handlers(group)
    for stamp in [stamp for stamp in stamps for _ in range(2)]:
        topic.publisher.publish(with_stamp(payload, stamp))
    tracemalloc.start()
    for n in range(2 * len(stamps)):
        handlers[n % 2](_take(kept))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert group.engine.sets == len(stamps)
    assert peak < _IMAGE_BYTES / 10
    sent = [bytes(_take(kept).content()) for _ in range(2 * len(stamps))]
    assert sent == [with_stamp(payload, stamp) for stamp in stamps for _ in range(2)]


def _handlers(group):
    return [handler(group, index, Vector3Stamped) for index in range(2)]


def test_a_watch_sees_what_came_before_it_what_comes_later_and_a_wake(here, topic):
    source, watch = here.backend.source(topic.subscription, print), here.backend.watch()
    topic.publisher.publish(vector(BEGIN))
    watch.add(source)
    assert watch.wait(_LONG_NS)[0] == [source]
    _told(source)
    topic.publisher.publish(vector(BEGIN + MS))
    ready, seen_until, _ = watch.wait(_LONG_NS)
    assert ready == [source]
    assert _told(source).received <= seen_until
    while watch.wait(0)[0]:
        assert _told(source) is None
    threading.Timer(0, watch.wake).start()
    # Once a second it looks into all, whatever it was told.
    assert not [each for each in watch.wait(_LONG_NS)[0] if _told(each)]
    watch.remove(source)
    topic.publisher.publish(vector(BEGIN + 2 * MS))
    assert watch.wait(0)[0] == []
    watch.close()


def test_a_look_knows_of_all_that_came_before_it(here, topic, monkeypatch):
    other = here.node.create_subscription(Vector3Stamped, "/u", print, _KEEP_ALL, raw=True)
    publisher = here.node.create_publisher(Vector3Stamped, "/u", _KEEP_ALL)
    sources = [_source(here, topic, print), messages.LibrclSource(here.rcl, buffers.Pool(here.rcl), other, print)]
    watch = here.backend.watch()
    for source in sources:
        watch.add(source)
    while any(_told(source) for source in watch.wait(0)[0]):
        pass
    for n in range(2):
        topic.publisher.publish(vector(BEGIN + n * MS))

    def now() -> int:
        """What comes between the event and the clock is older than the look."""
        monkeypatch.undo()
        publisher.publish(vector(BEGIN))
        return time.time_ns()

    monkeypatch.setattr(time, "time_ns", now)
    ready, seen_until, _ = watch.wait(_LONG_NS)
    assert ready == sources
    assert all(_told(source).received <= seen_until for source in ready)
    watch.close()
    here.node.destroy_subscription(other)
    here.node.destroy_publisher(publisher)


def test_a_message_that_dds_never_told_of_is_found_within_a_second(here, topic, monkeypatch):
    source, watch = here.backend.source(topic.subscription, print), here.backend.watch()
    watch.add(source)
    while watch.wait(0)[0]:
        assert _told(source) is None
    here.rcl.set_on_new_message(source.address, None, None)
    topic.publisher.publish(vector(BEGIN))
    assert _told(source) is None
    later = time.time_ns() + 1_000_000_000
    monkeypatch.setattr(time, "time_ns", lambda: later)
    assert watch.wait(0)[0] == [source]
    assert _told(source) is not None
    assert _told(source) is None
    assert watch.wait(0)[0] == []
    watch.close()


def test_what_is_pending_is_taken_without_asking_once_more(here, topic, monkeypatch):
    asked = []
    take = here.rcl.take
    # Once a second it asks in any case: in a moment that does not pass, never.
    moment = time.time_ns()
    monkeypatch.setattr(time, "time_ns", lambda: moment)

    def noted(*words):
        asked.append(words)
        return take(*words)

    monkeypatch.setattr(here.rcl, "take", noted)
    source, watch = _source(here, topic, print), here.backend.watch()
    watch.add(source)
    while watch.wait(0)[0]:
        assert _told(source) is None
    asked.clear()
    for n in range(3):
        topic.publisher.publish(vector(BEGIN + n * MS))
    while source.pending < 3:
        watch.wait(_LONG_NS)
    assert [_told(source) is None for _ in range(5)] == [False] * 3 + [True] * 2
    assert len(asked) == 3
    watch.close()


def _drained(changes):
    """Whether nothing changes any more, as what other processes of the domain do is known after a while."""
    return not changes.seen()


def test_changes_of_the_graph_are_seen_once_each(here, ros_domain, monkeypatch):
    # Only what is told counts here, not what is looked for now and then in any case.
    monkeypatch.setattr("syncrelay.ros.librcl.graph_changes._FORCE_S", math.inf)
    changes = here.backend.graph_changes(here.node)
    assert changes.seen()
    wait_until(lambda: _drained(changes), "the end of changes")
    publisher = here.node.create_publisher(Vector3Stamped, "/new", 10)
    assert changes.seen()
    wait_until(lambda: _drained(changes), "the end of changes")
    here.node.destroy_publisher(publisher)
    assert changes.seen()
    wait_until(lambda: _drained(changes), "the end of changes")
    there = rclpy.context.Context()
    rclpy.init(context=there, domain_id=ros_domain, args=["--ros-args", "--disable-external-lib-logs"])
    other = rclpy.create_node("there", context=there)
    try:
        wait_until(changes.seen, "another participant")
    finally:
        other.destroy_node()
        there.try_shutdown()


def test_a_change_of_the_graph_that_was_never_told_is_looked_for_every_minute(here, monkeypatch):
    changes = here.backend.graph_changes(here.node)
    changes.seen()
    wait_until(lambda: _drained(changes), "the end of changes")
    later = time.monotonic() + 60
    monkeypatch.setattr(time, "monotonic", lambda: later)
    assert changes.seen()
    assert not changes.seen()


def test_without_word_of_changes_in_the_graph_rclpy_is_used(here, monkeypatch):
    monkeypatch.setattr(LibrclBackend, "graph_changes", lambda *_: SimpleNamespace(seen=lambda: False))
    with pytest.raises(check.LibrclUnusableError, match="does not report changes in the graph"):
        check.checked_backend(here.node)


def _structure(*fields):
    return type("Other", (ctypes.Structure,), {"_fields_": list(fields)})


@pytest.mark.parametrize(
    ("structure", "other", "reason"),
    [
        ("_RoomyMessage", ("message", "buffer length capacity"), "larger"),
        ("_RoomyMessage", ("message", "length buffer capacity"), "fields|larger"),
        ("_RoomyInfo", ("info", "source_timestamp received_timestamp"), "larger"),
        ("_RoomyInfo", ("info", "gid received_timestamp source_timestamp a b c d e"), "timestamp"),
    ],
)
def test_structures_that_are_not_as_expected_are_found_out(here, monkeypatch, structure, other, reason):
    name, fields = other
    inner = _structure(*((field, ctypes.c_uint64) for field in fields.split()))
    monkeypatch.setattr(check, structure, _structure((name, inner), ("margin", ctypes.c_uint8 * 256)))
    with pytest.raises(check.LibrclUnusableError, match=reason):
        check.checked_backend(here.node)


def test_where_librcl_is_not_as_expected_rclpy_is_used_and_the_log_says_so(here, monkeypatch, caplog):
    assert choose_backend("direct", node=here.node, context=here.context).name is BackendName.LIBRCL
    empty = _structure(("info", _structure()), ("margin", ctypes.c_uint8 * 256))
    monkeypatch.setattr(check, "_RoomyInfo", empty)
    assert choose_backend(None, node=here.node, context=here.context).name is BackendName.RCLPY
    assert "messages pass through rclpy, at a higher cost" in caplog.text
    with pytest.raises(RosUnavailableError, match="SYNCRELAY_RECEIVE=direct: librcl is not as expected here"):
        choose_backend("direct", node=here.node, context=here.context)


def test_the_backend_can_be_chosen(here, caplog):
    caplog.set_level("INFO")
    assert choose_backend("rclpy", node=here.node, context=here.context).name is BackendName.RCLPY
    assert "as SYNCRELAY_RECEIVE asks" in caplog.text
    with pytest.raises(UsageError, match="SYNCRELAY_RECEIVE=dds: expected compiled, direct or rclpy"):
        choose_backend("dds", node=here.node, context=here.context)


def test_a_message_that_rcl_does_not_publish_says_why(here, topic):
    outlet, other = here.backend.outlet(topic.publisher), RclpyBackend(here.context).outlet(topic.publisher)
    payload = _published_and_taken(here, topic)
    # rcl's own: rclpy's would destroy the node too, since Kilted.
    with here.context.handle:
        here.context.handle.shutdown()
    with pytest.raises(PublishError, match="rcl_publish_serialized_message failed with"):
        outlet.send(payload)
    with pytest.raises(PublishError, match="context is invalid"):
        other.send_content(vector(BEGIN))
    # Whether to tell the set is asked in its group, which goes on.
    assert not outlet.is_heard()
    assert not other.is_heard()


def _published_and_taken(here, topic):
    source = _source(here, topic, print)
    topic.publisher.publish(vector(BEGIN))
    return _take(source)
