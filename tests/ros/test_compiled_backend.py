"""The compiled path from within, over DDS: whose memory a message is, and that no message and no wake is missed."""

import gc
import random
import sys
import threading
import time
from collections.abc import Iterator
from copy import copy
from ctypes import CFUNCTYPE, POINTER, c_int, c_void_p
from importlib.util import find_spec
from types import SimpleNamespace

import pytest

from syncrelay.cdr import LATEST_STAMP
from syncrelay.config import load_text
from syncrelay.dataflow.backend import ALL, BackendName, PublishError
from syncrelay.dataflow.group import GroupRelay
from syncrelay.errors import RosUnavailableError
from syncrelay.sync import DropReason
from tests.ros.cdr_messages import VECTOR, padded, vector, with_stamp
from tests.ros.configs import config, inputs
from tests.ros.processes import DEADLINE_S, wait_until
from tests.ros.streams import BEGIN, MS

pytest.importorskip("rclpy", reason="rclpy is not installed")
if find_spec("syncrelay.ros.compiled.path") is None:
    pytest.skip("the compiled path was not built: it needs a C compiler", allow_module_level=True)

from geometry_msgs.msg import Vector3Stamped
from rclpy.qos import HistoryPolicy, QoSProfile

from syncrelay.ros.backend_choice import choose_backend
from syncrelay.ros.compiled import backend as compiled_backend
from syncrelay.ros.compiled import path
from syncrelay.ros.handlers import handler
from syncrelay.ros.librcl.rcl import MessageInfo, Rcl
from tests.ros.in_process import own_node

pytestmark = pytest.mark.ros

_KEEP_ALL = QoSProfile(history=HistoryPolicy.KEEP_ALL)
_NEVER = 2**62
# How often to look for what comes in less than a millisecond, a thousand times over.
_SOON_S = 0.0005
_SECOND = 1_000_000_000
_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}


@pytest.fixture
def here(ros_domain: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[SimpleNamespace]:
    """A node of this process, the compiled backend as it proved itself on it, and topics."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with own_node(ros_domain) as own:
        own.backend = choose_backend("compiled", node=own.node, context=own.context)
        own.topics = [_topic(own.node, f"/t{n}") for n in range(3)]
        yield own


def _topic(node, name, profile=_KEEP_ALL):
    """A topic with a subscription and a publisher that keep all, or what else a test says."""
    subscription = node.create_subscription(Vector3Stamped, name, print, profile, raw=True)
    return SimpleNamespace(subscription=subscription, publisher=node.create_publisher(Vector3Stamped, name, profile))


def _group(**keys):
    text = config({"front": {"policy": "exact_time", "topics": inputs(_PAIR), **keys}})
    return GroupRelay(load_text(text).groups[0], now=time.monotonic_ns, flow=compiled_backend.CompiledBackend.flow)


def _take(source):
    """Its oldest message, whether anybody told it or not."""
    source.pending = ALL
    return source.take()


def test_a_message_comes_out_as_it_went_in(here):
    source = here.backend.source(here.topics[0].subscription, print)
    payload = vector(BEGIN, frame_id="a frame")
    here.topics[0].publisher.publish(payload)
    taken = _take(source)
    assert bytes(taken.content()) == padded(payload)
    assert taken.received > BEGIN
    assert _take(source) is None


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
        payload = _take(source)
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
    group.connect(0, here.backend.outlet(topic.publisher), restamped=False)
    for n in range(20):
        topic.publisher.publish(vector(BEGIN + n * MS))
        source.deliver(_take(source))
    assert source.pool.lent == 21
    gc.disable()
    try:
        source.deliver = print
        del group
        assert source.pool.lent == 1
    finally:
        gc.enable()


@pytest.mark.parametrize("little_endian", [True, False])
def test_a_payload_that_serves_two_sets_keeps_its_own_stamp(here, little_endian):
    topic, chance = here.topics[0], random.Random(2)
    source, outlet = here.backend.source(topic.subscription, print), here.backend.outlet(topic.publisher)
    for stamp in [0, -1, LATEST_STAMP, *(chance.randrange(-(2**31) * _SECOND, LATEST_STAMP) for _ in range(50))]:
        original = padded(vector(BEGIN, little_endian=little_endian))
        topic.publisher.publish(original)
        payload = _take(source)
        outlet.send_stamped(payload, stamp)
        outlet.send(payload)
        assert bytes(_take(source).content()) == with_stamp(original, stamp)
        assert bytes(_take(source).content()) == bytes(payload.content()) == original
    with pytest.raises(ValueError, match="does not fit"):
        outlet.send_stamped(payload, LATEST_STAMP + 1)
    assert bytes(payload.content()) == original


def test_a_message_that_rcl_does_not_publish_says_why(here):
    topic = here.topics[0]
    source, outlet = here.backend.source(topic.subscription, print), here.backend.outlet(topic.publisher)
    topic.publisher.publish(vector(BEGIN))
    payload = _take(source)
    with here.context.handle:
        here.context.handle.shutdown()
    for send in (lambda: outlet.send(payload), lambda: outlet.send_content(vector(BEGIN))):
        with pytest.raises(PublishError, match="rcl_publish_serialized_message failed with"):
            send()
    assert outlet.sent == 0
    assert not outlet.is_heard()


class _Thread(threading.Thread):
    """Receives in an inbox until it is ended; whatever ends it is raised there."""

    def __init__(self, inbox, longest_ns: int) -> None:
        # Where a test fails, it must not keep Python from ending.
        super().__init__(daemon=True)
        self._inbox, self._longest, self._ended = inbox, longest_ns, False
        self.turns = 0

    def run(self) -> None:
        while not self._ended:
            self._inbox.receive(self._longest)
            self.turns += 1

    def end(self) -> None:
        self._ended = True
        self._inbox.wake()
        self.join(DEADLINE_S)
        assert not self.is_alive()


def test_no_message_and_no_wake_is_missed_without_the_poll_of_every_second(here):
    came, chance = [], random.Random(3)
    inbox = path.Inbox(force_ns=_NEVER)
    for topic in here.topics:
        inbox.add(here.backend.source(topic.subscription, lambda payload: came.append(payload.received)))
    # It never ends by itself: a wake that is missed is one that this test waits for in vain.
    thread = _Thread(inbox, _NEVER)
    thread.start()
    for n in range(3000):
        chance.choice(here.topics).publisher.publish(vector(BEGIN + n))
        if n % 3 == 0:
            wait_until(lambda n=n: len(came) == n + 1, "the message", poll_s=_SOON_S)
        if n % 50 == 0:
            turns = thread.turns
            inbox.wake()
            wait_until(lambda turns=turns: thread.turns > turns, "the wake", poll_s=_SOON_S)
    wait_until(lambda: len(came) == 3000, "all messages")
    thread.end()
    inbox.close()


def test_messages_of_several_topics_are_delivered_by_their_time_of_receipt(here):
    came, chance, inbox = [], random.Random(4), here.backend.inbox()
    for topic in here.topics:
        inbox.add(here.backend.source(topic.subscription, lambda payload: came.append(payload.received)))
    for n in range(2000):
        chance.choice(here.topics).publisher.publish(vector(BEGIN + n))
        if chance.random() < 0.01:
            inbox.receive_once(0)
    while len(came) < 2000:
        inbox.deliver_all()
    assert came == sorted(came)
    inbox.close()


def test_the_first_message_waits_for_those_that_come_with_it_where_the_file_says_so(here):
    came: list[object] = []
    inbox = here.backend.inbox(coalesce_ns=50 * MS)
    source = here.backend.source(here.topics[0].subscription, came.append)
    inbox.add(source)
    inbox.receive_once(0)
    here.topics[0].publisher.publish(vector(BEGIN))
    while not came:
        inbox.receive_once(_SECOND)
    # However busy the machine is, never less.
    assert source.waited > 40 * MS
    inbox.close()


def test_a_source_whose_messages_cannot_be_taken_in_is_named_and_the_others_go_on(here):
    came: list[object] = []
    inbox = here.backend.inbox()
    failing = here.backend.source(here.topics[0].subscription, lambda _: dict[str, object]()["no such"])
    sound = here.backend.source(here.topics[1].subscription, came.append)
    for source in (failing, sound):
        inbox.add(source)
    for topic in here.topics[:2]:
        topic.publisher.publish(vector(BEGIN))
    while not (inbox.failed and came):
        inbox.receive_once(_SECOND)
    assert [(source, type(error)) for source, error in inbox.failed.items()] == [(failing, KeyError)]
    inbox.remove(failing)
    assert not inbox.failed
    here.topics[1].publisher.publish(vector(BEGIN))
    while len(came) < 2:
        inbox.receive_once(_SECOND)
    inbox.close()


def test_sources_come_and_go_while_messages_come(here):
    came, ended = [], threading.Event()
    # What is never taken must not hold up who publishes.
    topics = [_topic(here.node, f"/u{n}", QoSProfile(depth=100)) for n in range(3)]

    def publish() -> None:
        while not ended.is_set():
            for topic in topics:
                topic.publisher.publish(vector(BEGIN))

    thread = threading.Thread(target=publish)
    inbox = here.backend.inbox()
    thread.start()
    try:
        for _ in range(300):
            sources = [here.backend.source(topic.subscription, lambda _: came.append(1)) for topic in topics]
            for source in sources:
                inbox.add(source)
            inbox.receive_once(_SECOND)
            for source in sources:
                inbox.remove(source)
    finally:
        ended.set()
        thread.join(DEADLINE_S)
    assert not thread.is_alive()
    inbox.close()
    assert came
    gc.collect()


def test_a_clock_that_is_set_back_holds_up_no_topic(here):
    real = Rcl()

    @CFUNCTYPE(c_int, c_void_p, c_void_p, POINTER(MessageInfo), c_void_p)
    def take_before(subscription, message, info, allocation):
        code = real.take(c_void_p(subscription), c_void_p(message), info, c_void_p(allocation))
        info.contents.received_timestamp += 3600 * _SECOND
        return code

    rcl = copy(real)
    rcl.take = take_before  # type: ignore[assignment]  # a function of ours, not one of the library
    backend = compiled_backend.CompiledBackend(rcl)
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


@pytest.mark.parametrize("name", ["compiled", "direct"])
def test_a_source_may_be_removed_by_who_gets_its_messages(here, name):
    backend = choose_backend(name, node=here.node, context=here.context)
    came: list[object] = []
    inbox = backend.inbox()

    def deliver(payload) -> None:
        came.append(payload)
        inbox.remove(source)

    source = backend.source(here.topics[0].subscription, deliver)
    inbox.add(source)
    for _ in range(3):
        here.topics[0].publisher.publish(vector(BEGIN))
    for _ in range(3):
        inbox.receive_once(0)
    assert len(came) == 1
    inbox.close()


@pytest.mark.parametrize("name", ["compiled", "direct"])
def test_an_inbox_that_is_closed_delivers_nothing_more(here, name):
    backend = choose_backend(name, node=here.node, context=here.context)
    came: list[object] = []
    inbox = backend.inbox()
    inbox.add(backend.source(here.topics[0].subscription, came.append))
    for _ in range(300):
        here.topics[0].publisher.publish(vector(BEGIN))
    inbox.receive_once(_SECOND)
    delivered = len(came)
    assert 0 < delivered < 300
    inbox.close()
    assert len(came) == delivered


def test_a_source_is_drained_by_one_inbox_only(here):
    inbox, source = here.backend.inbox(), here.backend.source(here.topics[0].subscription, print)
    inbox.add(source)
    for other in (inbox, here.backend.inbox()):
        with pytest.raises(ValueError, match="drained already"):
            other.add(source)
    inbox.close()


def test_a_source_that_is_fed_elsewhere_in_the_midst_of_a_delivery_that_fails_tells_what_failed(here):
    topic, flow = here.topics[0], _group().flow
    told: list[Exception] = []

    class Failing:
        def add(self, _message, *, now):
            source.deliver = print
            raise KeyError(now)

    flow.engine, inbox = Failing(), here.backend.inbox()
    source = here.backend.source(topic.subscription, flow.by_header(0, told.append))
    inbox.add(source)
    topic.publisher.publish(vector(BEGIN))
    inbox.receive_once(_SECOND)
    assert [type(error) for error in told] == [KeyError]
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


def test_where_it_is_not_as_expected_librcl_is_used_from_python_and_the_log_says_so(here, monkeypatch, caplog):
    monkeypatch.setattr(compiled_backend, "_SIZES", (1, 2, 3))
    assert choose_backend(None, node=here.node, context=here.context).name is BackendName.LIBRCL
    assert "messages pass through librcl, without a copy in Python, at a higher cost: the compiled path" in caplog.text
    with pytest.raises(RosUnavailableError, match="SYNCRELAY_RECEIVE=compiled: the compiled path is not as expected"):
        choose_backend("compiled", node=here.node, context=here.context)


def test_where_it_was_built_of_a_source_that_lacked_something_librcl_is_used(here, monkeypatch, caplog):
    for module in ("backend", "check"):
        monkeypatch.delitem(sys.modules, f"syncrelay.ros.compiled.{module}")
    monkeypatch.delattr(path, "Outlet")
    assert choose_backend(None, node=here.node, context=here.context).name is BackendName.LIBRCL
    assert "the compiled path is not as expected here (module" in caplog.text


def test_where_a_message_does_not_come_back_as_it_was_it_is_not_used(here, monkeypatch):
    send = compiled_backend.CompiledOutlet.send
    monkeypatch.setattr(
        compiled_backend.CompiledOutlet, "send", lambda outlet, payload: send_changed(send, outlet, payload)
    )
    with pytest.raises(RosUnavailableError, match="a message does not come back as it was"):
        choose_backend("compiled", node=here.node, context=here.context)


def send_changed(send, outlet, payload) -> None:
    payload.content()[8] ^= 1
    send(outlet, payload)
