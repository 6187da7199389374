"""The compiled path from within: whose memory a message is, what DDS reports, and how it is found not to work."""

import ctypes
import gc
import math
import random
import sys
import time
import tracemalloc
from collections.abc import Iterator
from ctypes import CFUNCTYPE, c_int, c_size_t, c_void_p
from types import SimpleNamespace

import pytest

from syncrelay.config import load_text
from syncrelay.dataflow.backend import BackendName
from syncrelay.dataflow.bugs import Bugs
from syncrelay.dataflow.group import GroupRelay
from syncrelay.dataflow.manifest import ManifestWriter
from syncrelay.dataflow.manifest_queue import ManifestQueue
from syncrelay.errors import RosUnavailableError
from syncrelay.sync import DropReason
from tests.ros.cdr_messages import VECTOR, padded, vector, with_stamp
from tests.ros.configs import config, inputs
from tests.ros.processes import wait_until
from tests.ros.stage import IS_COMPILED
from tests.ros.streams import BEGIN, MS

pytest.importorskip("rclpy", reason="rclpy is not installed")
if not IS_COMPILED:
    pytest.skip("the compiled path was not built: it needs a C compiler", allow_module_level=True)

from geometry_msgs.msg import Vector3Stamped

from syncrelay.relay.outputs import handler
from syncrelay.ros import backend_choice
from syncrelay.ros.backend_choice import choose_backend
from syncrelay.ros.compiled import backend as compiled_backend
from syncrelay.ros.compiled import path
from tests.ros.in_process import own_backend, own_node, take

pytestmark = pytest.mark.ros

_IMAGE_BYTES = 1_000_000
_SECOND = 1_000_000_000
_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}


@pytest.fixture
def here(ros_domain: int) -> Iterator[SimpleNamespace]:
    with own_backend(ros_domain, "compiled") as own:
        yield own


def _group(**keys):
    text = config({"front": {"policy": "exact_time", "topics": inputs(_PAIR), **keys}})
    return GroupRelay(load_text(text).groups[0], now=time.monotonic_ns, flow=path.Flow)


def _stand_in(monkeypatch, name: str, function) -> None:
    """Have a backend that is made from now on call another function in the place of one of librcl's.

    `function` takes librcl's own as its first argument.
    """
    of_librcl = compiled_backend.addresses()
    prototype = CFUNCTYPE(c_int, *_ARGUMENTS[name])
    own = prototype(of_librcl[name])
    other = prototype(lambda *arguments: function(own, *arguments))
    address = ctypes.cast(other, c_void_p).value or 0
    # It keeps the function alive, too.
    monkeypatch.setattr(compiled_backend, "addresses", lambda: of_librcl | {name: address} if other else {})


_TAKE, _ARRAY_INIT = "rcl_take_serialized_message", "rcutils_uint8_array_init"
_SET_ON_NEW_MESSAGE = "rcl_subscription_set_on_new_message_callback"
_ARGUMENTS = {_TAKE: (c_void_p,) * 4, _ARRAY_INIT: (c_void_p, c_size_t, c_void_p), _SET_ON_NEW_MESSAGE: (c_void_p,) * 3}


def test_every_memory_comes_back_once_whatever_became_of_its_message(here):
    # One topic feeds both inputs of two groups: each message has up to four owners at a time.
    topic, groups = here.topics[0], [_group(queue_size=5), _group(queue_size=20, restamp="latest")]
    source = here.backend.source(topic.subscription, print)
    takes = []
    for group in groups:
        for index in range(2):
            group.connect(index, here.backend.outlet(here.topics[1].publisher), restamped=True)
        takes.append([handler(group, index, Vector3Stamped) for index in range(2)])
    chance = random.Random(1)
    for n in range(3000):
        topic.publisher.publish(vector(BEGIN + (n // 2 - chance.choice([0, 0, 0, 1, 3])) * MS))
        payload = take(source)
        for pair in takes:
            pair[n % 2](payload)
        del payload
        # Those kept for the queues of two groups and two inputs, and the one for the next message.
        assert source.pool.lent <= 2 * 20 + 2
    assert [group.failure for group in groups] == [None, None]
    assert all(group.engine.sets > 100 for group in groups)
    for group in groups:
        group.flush(DropReason.SHUTDOWN)
    gc.collect()
    assert source.pool.lent == 1
    assert source.pool.made - source.pool.freed <= 9


def test_a_group_that_ends_gives_its_memory_back_without_the_collector(here):
    topic, group = here.topics[0], _group(queue_size=30)
    source = here.backend.source(topic.subscription, handler(group, 0, Vector3Stamped))
    outlet = here.backend.outlet(topic.publisher)
    group.connect(0, outlet, restamped=False)
    writer = ManifestWriter(group.config, node="/n", topics=[("/camera", "/a"), ("/lidar", "/b")], bundle=None)
    queue = ManifestQueue(bugs=Bugs())
    group.tell_sets(queue.begin("front", writer, outlet))
    for n in range(20):
        topic.publisher.publish(vector(BEGIN + n * MS))
        source.deliver(take(source))
    assert source.pool.lent == 21
    gc.disable()
    try:
        source.deliver = print
        del group
        assert source.pool.lent == 1
    finally:
        gc.enable()


def test_python_never_holds_the_bytes_of_a_message(here):
    """Nor are they deserialized: behind the stamp there is nothing that any type could be read from."""
    topic = here.topics[0]
    payload = padded(vector(BEGIN)[:12] + b"\xff" * _IMAGE_BYTES)
    stamps = [BEGIN + n * MS for n in range(20)]
    group = _group(restamp="latest")
    source = here.backend.source(topic.subscription, print)
    for index in range(2):
        group.connect(index, here.backend.outlet(topic.publisher), restamped=True)
    handlers = [handler(group, index, Vector3Stamped) for index in range(2)]
    for stamp in [stamp for stamp in stamps for _ in range(2)]:
        topic.publisher.publish(with_stamp(payload, stamp))
    tracemalloc.start()
    for n in range(2 * len(stamps)):
        handlers[n % 2](take(source))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert group.engine.sets == len(stamps)
    assert peak < _IMAGE_BYTES / 10
    sent = [bytes(take(source).content()) for _ in range(2 * len(stamps))]
    assert sent == [with_stamp(payload, stamp) for stamp in stamps for _ in range(2)]


def test_a_message_that_dds_never_reported_is_found_by_the_next_poll_of_all(here, monkeypatch):
    _stand_in(monkeypatch, _SET_ON_NEW_MESSAGE, lambda *_: 0)
    backend = compiled_backend.CompiledBackend(path.Librcl(compiled_backend.addresses()))
    came: list[object] = []
    inbox = path.Inbox(force_ns=100 * MS)
    inbox.add(backend.source(here.topics[0].subscription, came.append))
    inbox.receive_once(0)
    here.topics[0].publisher.publish(vector(BEGIN))
    while not came:
        inbox.receive_once(10 * MS)
    inbox.close()


def test_librcl_is_asked_once_for_each_message_that_was_reported(here, monkeypatch):
    asked: list[int] = []

    def counted(take, *arguments):
        asked.append(1)
        return take(*arguments)

    _stand_in(monkeypatch, _TAKE, counted)
    backend = compiled_backend.CompiledBackend(path.Librcl(compiled_backend.addresses()))
    inbox, came = path.Inbox(force_ns=2**62), list[object]()
    inbox.add(backend.source(here.topics[0].subscription, came.append))
    inbox.receive_once(0)
    asked.clear()
    for n in range(3):
        here.topics[0].publisher.publish(vector(BEGIN + n * MS))
    while len(came) < 3:
        inbox.receive_once(_SECOND)
    inbox.receive_once(0)
    assert len(asked) == 3
    inbox.close()


def test_a_clock_that_is_set_back_holds_up_no_topic(here, monkeypatch):
    def take_before(take, subscription, message, info, allocation):
        code = take(subscription, message, info, allocation)
        received = ctypes.cast(info, ctypes.POINTER(ctypes.c_int64))
        received[1] += 3600 * _SECOND
        return code

    _stand_in(monkeypatch, _TAKE, take_before)
    backend = compiled_backend.CompiledBackend(path.Librcl(compiled_backend.addresses()))
    came: list[object] = []
    inbox = backend.inbox()
    source = backend.source(here.topics[0].subscription, came.append)
    inbox.add(source)
    for _ in range(3):
        here.topics[0].publisher.publish(vector(BEGIN))
    for _ in range(10):
        inbox.receive_once(0)
    assert len(came) == 3
    assert source.waited == 0
    inbox.close()


def test_a_source_is_drained_by_one_inbox_only(here):
    inbox, source = here.backend.inbox(), here.backend.source(here.topics[0].subscription, print)
    inbox.add(source)
    for other in (inbox, here.backend.inbox()):
        with pytest.raises(ValueError, match="drained already"):
            other.add(source)
    inbox.close()


def test_a_source_whose_receiver_is_replaced_while_a_delivery_fails_reports_the_failure(here):
    topic, flow = here.topics[0], _group().flow
    reported: list[Exception] = []

    class Failing:
        def add(self, _message, *, now):
            source.deliver = print
            raise KeyError(now)

    flow.engine, inbox = Failing(), here.backend.inbox()
    source = here.backend.source(topic.subscription, flow.by_header(0, reported.append))
    inbox.add(source)
    topic.publisher.publish(vector(BEGIN))
    inbox.receive_once(_SECOND)
    assert [type(error) for error in reported] == [KeyError]
    inbox.close()


def test_an_inbox_that_is_forgotten_leaves_what_dds_writes_to(here):
    kept = []
    for _ in range(20):
        inbox = here.backend.inbox()
        for topic in here.topics:
            kept.append(here.backend.source(topic.subscription, print))
            inbox.add(kept[-1])
        del inbox
        for topic in here.topics:
            topic.publisher.publish(vector(BEGIN))


def test_changes_of_the_graph_are_seen_once_each(here, ros_domain, monkeypatch):
    # Without the look of every minute.
    monkeypatch.setattr(compiled_backend, "_FORCE_S", math.inf)
    changes = here.backend.graph_changes(here.node)
    assert changes.seen()
    # What other processes of the domain did is known after a while.
    wait_until(lambda: not changes.seen(), "the end of changes")
    publisher = here.node.create_publisher(Vector3Stamped, "/new", 10)
    assert changes.seen()
    wait_until(lambda: not changes.seen(), "the end of changes")
    here.node.destroy_publisher(publisher)
    assert changes.seen()
    wait_until(lambda: not changes.seen(), "the end of changes")
    with own_node(ros_domain, "there"):
        wait_until(changes.seen, "another participant")


def test_a_change_of_the_graph_that_was_never_reported_is_looked_for_every_minute(here, monkeypatch):
    changes = here.backend.graph_changes(here.node)
    changes.seen()
    wait_until(lambda: not changes.seen(), "the end of changes")
    later = time.monotonic() + 60
    monkeypatch.setattr(time, "monotonic", lambda: later)
    assert changes.seen()
    assert not changes.seen()


def _written(place: int, at: int):
    """librcl's function, which also writes a byte into what its argument `place` points to."""

    def function(own, *arguments):
        code = own(*arguments)
        ctypes.c_uint8.from_address(arguments[place] + at).value = 0x5A
        return code

    return function


# The sizes of rmw_serialized_message_t and rmw_message_info_t, and where some of their fields are.
@pytest.mark.parametrize(
    ("name", "changed", "reason"),
    [
        (_ARRAY_INIT, _written(0, 64), "rmw_serialized_message_t is larger than expected"),
        (_ARRAY_INIT, _written(0, 8), "rmw_serialized_message_t has other fields"),
        (_ARRAY_INIT, _written(0, 24), "rcutils_allocator_t has other fields"),
        (_TAKE, _written(2, 64), "rmw_message_info_t is larger than expected"),
        (_TAKE, _written(2, 15), "the time of receipt is not as expected"),
        (_SET_ON_NEW_MESSAGE, lambda *_: 1, "rcl_subscription_set_on_new_message_callback failed with 1"),
    ],
)
def test_where_librcl_is_not_as_expected_the_compiled_path_is_not_used(here, monkeypatch, name, changed, reason):
    _stand_in(monkeypatch, name, changed)
    with pytest.raises(RosUnavailableError) as raised:
        choose_backend("compiled", node=here.node, context=here.context)
    assert str(raised.value).startswith(f"SYNCRELAY_RECEIVE=compiled: the compiled path does not work here ({reason}")


def test_where_the_compiled_path_does_not_work_rclpy_is_used_and_the_log_says_so(here, monkeypatch, caplog):
    _stand_in(monkeypatch, _SET_ON_NEW_MESSAGE, lambda *_: 1)
    assert choose_backend(None, node=here.node, context=here.context).name is BackendName.RCLPY
    assert "messages pass through rclpy, where a message costs about 1.5 times the CPU" in caplog.text
    assert "the compiled path does not work here (rcl_subscription_set_on_new_message_callback failed" in caplog.text
    assert "; install syncrelay again; if this stays, please report it" in caplog.text


def test_where_changes_of_the_graph_are_not_reported_rclpy_is_used(here, monkeypatch):
    monkeypatch.setattr(compiled_backend.GraphChanges, "seen", lambda _: False)
    with pytest.raises(RosUnavailableError, match="does not report changes in the graph"):
        choose_backend("compiled", node=here.node, context=here.context)


def test_where_a_message_does_not_come_back_as_it_was_rclpy_is_used(here, monkeypatch):
    send = compiled_backend.CompiledOutlet.send

    def send_changed(outlet, payload) -> None:
        payload.content()[8] ^= 1
        send(outlet, payload)

    monkeypatch.setattr(compiled_backend.CompiledOutlet, "send", send_changed)
    with pytest.raises(RosUnavailableError, match="a message does not come back as it was"):
        choose_backend("compiled", node=here.node, context=here.context)


def test_one_that_was_built_from_another_source_is_not_loaded_and_the_log_says_what_to_do(here, monkeypatch, caplog):
    monkeypatch.setattr(backend_choice, "source_fingerprint", lambda: "0" * 64)
    # Were it loaded now, it would be found to lack something.
    monkeypatch.delitem(sys.modules, "syncrelay.ros.compiled.backend")
    monkeypatch.delattr(path, "Outlet")
    assert choose_backend(None, node=here.node, context=here.context).name is BackendName.RCLPY
    (record,) = caplog.records
    assert "the compiled path was built from another version of path.pyx; run `pip install -e .`" in record.message


def test_one_that_cannot_be_loaded_is_not_used_and_the_log_says_why(here, monkeypatch, caplog):
    monkeypatch.delitem(sys.modules, "syncrelay.ros.compiled.backend")
    monkeypatch.delattr(path, "Outlet")
    assert choose_backend(None, node=here.node, context=here.context).name is BackendName.RCLPY
    assert "the compiled path does not work here (module" in caplog.text
