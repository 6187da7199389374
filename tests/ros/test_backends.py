"""What each backend promises to the receive loop, over DDS within this process: both are held to the same."""

import random
import threading
import time
from collections.abc import Iterator
from itertools import count, pairwise
from types import SimpleNamespace
from typing import Any

import pytest

from syncrelay.cdr import LATEST_STAMP
from syncrelay.dataflow.backend import BackendName, PublishError
from syncrelay.errors import RosUnavailableError, UsageError
from tests.ros.cdr_messages import padded, vector, with_stamp
from tests.ros.processes import DEADLINE_S, wait_until
from tests.ros.stage import BACKENDS
from tests.ros.streams import BEGIN

pytest.importorskip("rclpy", reason="rclpy is not installed")

from geometry_msgs.msg import Vector3Stamped
from rclpy.guard_condition import GuardCondition
from rclpy.qos import QoSProfile

from syncrelay.ros import backend_choice
from syncrelay.ros.backend_choice import choose_backend
from tests.ros.in_process import own_backend, take, vectors_on

pytestmark = pytest.mark.ros

_SECOND = 1_000_000_000
# Longer than any test takes.
_NEVER = 1_000 * _SECOND
# How often to look for what comes in less than a millisecond, a thousand times over.
_SOON_S = 0.0005


@pytest.fixture(params=BACKENDS)
def here(request, ros_domain: int) -> Iterator[SimpleNamespace]:
    with own_backend(ros_domain, request.param) as own:
        yield own


def test_a_message_comes_out_as_it_went_in(here):
    source = here.backend.source(here.topics[0].subscription, print)
    payload = vector(BEGIN, frame_id="a frame")
    here.topics[0].publisher.publish(payload)
    taken = take(source)
    assert bytes(taken.content()) == padded(payload)
    assert taken.received > BEGIN
    assert take(source) is None


@pytest.mark.parametrize("little_endian", [True, False])
def test_a_payload_that_serves_two_sets_keeps_its_own_stamp(here, little_endian):
    topic, chance = here.topics[0], random.Random(2)
    source, outlet = here.backend.source(topic.subscription, print), here.backend.outlet(topic.publisher)
    for stamp in [0, -1, LATEST_STAMP, *(chance.randrange(-(2**31) * _SECOND, LATEST_STAMP) for _ in range(50))]:
        original = padded(vector(BEGIN, little_endian=little_endian))
        topic.publisher.publish(original)
        payload = take(source)
        outlet.send_stamped(payload, stamp)
        outlet.send(payload)
        assert bytes(take(source).content()) == with_stamp(original, stamp)
        assert bytes(take(source).content()) == bytes(payload.content()) == original
    with pytest.raises(ValueError, match="does not fit"):
        outlet.send_stamped(payload, LATEST_STAMP + 1)
    assert bytes(payload.content()) == original


def test_messages_that_a_short_history_gave_up_are_counted_by_their_publisher(here):
    topic, chance = vectors_on(here.node, "/short", QoSProfile(depth=3)), random.Random(3)
    publishers = [topic.publisher]
    # rclpy does not say whose a message is.
    if here.backend.name is BackendName.COMPILED:
        publishers.append(here.node.create_publisher(Vector3Stamped, "/short", 10))
    source = here.backend.source(topic.subscription, print)
    numbers = [count(1) for _ in publishers]
    came: list[list[int]] = [[] for _ in publishers]
    for _ in range(300):
        whose = chance.randrange(len(publishers))
        for _ in range(chance.choice([1, 1, 2, 3, 5, 8])):
            publishers[whose].publish(vector(BEGIN, frame_id=f"{whose} {next(numbers[whose])}"))
        while (payload := take(source)) is not None:
            of, number = map(int, bytes(payload.content())[16:].split(b"\0")[0].split())
            came[of].append(number)
    told = source.deliveries()
    assert {(each.first, each.newest, each.delivered, each.longest_gap) for each in told} == {
        (got[0], got[-1], len(got), max(after - before - 1 for before, after in pairwise(got))) for got in came
    }
    if len(publishers) > 1:
        infos = here.node.get_publishers_info_by_topic("/short")
        assert {each.gid for each in told} == {bytes(each.endpoint_gid) for each in infos}
    assert all(each.published > BEGIN and 0 <= each.least_way < _SECOND for each in told)
    assert [(each.longest_gap, each.least_way) for each in source.deliveries()] == [(0, None)] * len(told)


def test_what_is_serialized_here_is_published_and_counted(here):
    topic = here.topics[0]
    source, outlet = here.backend.source(topic.subscription, print), here.backend.outlet(topic.publisher)
    contents = [padded(vector(BEGIN, frame_id="x" * length)) for length in (0, 1, 1000, 5)]
    for content in contents:
        outlet.send_content(content)
    assert [bytes(take(source).content()) for _ in contents] == contents
    assert outlet.sent == 4
    assert outlet.is_heard()


def test_a_message_that_rcl_does_not_publish_says_why(here):
    topic = here.topics[0]
    source, outlet = here.backend.source(topic.subscription, print), here.backend.outlet(topic.publisher)
    topic.publisher.publish(vector(BEGIN))
    payload = take(source)
    # rcl's own: rclpy's would destroy the node too, since Kilted.
    with here.context.handle:
        here.context.handle.shutdown()
    for send in (lambda: outlet.send(payload), lambda: outlet.send_content(vector(BEGIN))):
        with pytest.raises(PublishError, match=r"rcl_publish_serialized_message failed with|context is invalid"):
            send()
    assert outlet.sent == 0
    # This is asked in the group of the outlet, which goes on.
    assert not outlet.is_heard()


class _Thread(threading.Thread):
    """Receives in an inbox until it is ended; whatever ends it is raised there."""

    def __init__(self, inbox) -> None:
        # Where a test fails, it must not keep Python from ending.
        super().__init__(daemon=True)
        self._inbox, self._ended = inbox, False
        self.turns = 0

    def run(self) -> None:
        while not self._ended:
            self._inbox.receive(_NEVER)
            self.turns += 1

    def end(self) -> None:
        self._ended = True
        self._inbox.wake()
        self.join(DEADLINE_S)
        assert not self.is_alive()


def test_no_message_and_no_wake_is_missed(here):
    came, chance = [], random.Random(3)
    inbox = here.backend.inbox()
    # Without the poll of every second, which would find what was missed.
    if here.backend.name is BackendName.COMPILED:
        inbox = type(inbox)(force_ns=_NEVER)
    for topic in here.topics:
        inbox.add(here.backend.source(topic.subscription, lambda payload: came.append(payload.received)))
    # It never ends by itself: a wake that is missed is one that this test waits for in vain.
    thread = _Thread(inbox)
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


def test_a_wake_that_the_middleware_takes_for_none_ends_a_wait_all_the_same(here, monkeypatch):
    monkeypatch.setattr(GuardCondition, "trigger", lambda _: None)
    inbox = here.backend.inbox()
    inbox.wake()
    inbox.receive(_NEVER)
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


def test_each_source_tells_how_long_its_messages_waited(here):
    came: list[Any] = []
    looked, inbox = 0, here.backend.inbox()
    sources = [here.backend.source(topic.subscription, came.append) for topic in here.topics[:2]]
    for source in sources:
        inbox.add(source)
    here.topics[0].publisher.publish(vector(BEGIN))
    time.sleep(0.1)
    while not came:
        looked = time.time_ns()
        inbox.receive_once(_SECOND)
    assert sources[0].waited >= looked - came[0].received
    assert sources[0].waited > 0 == sources[1].waited
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
    # What is never taken must not hold up the publishers.
    topics = [vectors_on(here.node, f"/u{n}", QoSProfile(depth=100)) for n in range(3)]

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


def test_a_source_may_be_removed_while_it_delivers(here):
    came: list[object] = []
    inbox = here.backend.inbox()

    def deliver(payload) -> None:
        came.append(payload)
        inbox.remove(source)

    source = here.backend.source(here.topics[0].subscription, deliver)
    inbox.add(source)
    for _ in range(3):
        here.topics[0].publisher.publish(vector(BEGIN))
    for _ in range(3):
        inbox.receive_once(0)
    assert len(came) == 1
    inbox.close()


def test_an_inbox_that_is_closed_delivers_nothing_more(here):
    came: list[object] = []
    inbox = here.backend.inbox()
    inbox.add(here.backend.source(here.topics[0].subscription, came.append))
    for _ in range(300):
        here.topics[0].publisher.publish(vector(BEGIN))
    inbox.receive_once(_SECOND)
    delivered = len(came)
    assert 0 < delivered < 300
    inbox.close()
    assert len(came) == delivered


def test_the_backend_can_be_chosen(here, caplog):
    caplog.set_level("INFO")
    chosen = choose_backend("rclpy", node=here.node, context=here.context)
    assert chosen.name is BackendName.RCLPY
    assert "messages pass through rclpy, as SYNCRELAY_RECEIVE asks" in caplog.text
    with pytest.raises(UsageError, match="SYNCRELAY_RECEIVE=direct: expected compiled or rclpy"):
        choose_backend("direct", node=here.node, context=here.context)


def test_without_the_compiled_path_the_log_says_what_that_costs_and_how_to_get_it(here, monkeypatch, caplog):
    monkeypatch.setattr(backend_choice, "find_spec", lambda _: None)
    assert choose_backend(None, node=here.node, context=here.context).name is BackendName.RCLPY
    assert "messages pass through rclpy, where a message costs about 1.5 times the CPU" in caplog.text
    assert "the compiled path was not built; install a C compiler" in caplog.text
    with pytest.raises(RosUnavailableError, match="SYNCRELAY_RECEIVE=compiled: the compiled path was not built"):
        choose_backend("compiled", node=here.node, context=here.context)
