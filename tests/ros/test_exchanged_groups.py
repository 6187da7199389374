"""Groups exchanged for others while DDS refuses some of what they need: all of the new run, or all of the old."""

import random
from collections.abc import Iterator
from dataclasses import replace
from threading import Thread
from types import SimpleNamespace
from typing import Any

import pytest

from syncrelay.config import Config, StampField, load_text
from syncrelay.config.reload import Subscription, exchange
from syncrelay.errors import ReloadError
from syncrelay.explain import Refusal
from syncrelay.relay.ports import Purpose
from syncrelay.runtime import SYSTEM
from tests.faults.extent import chosen
from tests.ros.configs import config
from tests.ros.processes import wait_until
from tests.ros.stage import BACKENDS

in_process = pytest.importorskip("tests.ros.in_process", reason="rclpy is not installed")
entities = pytest.importorskip("syncrelay.relay.entities")
choose_backend = pytest.importorskip("syncrelay.ros.backend_choice").choose_backend
GroupBindings = pytest.importorskip("syncrelay.relay.bindings").GroupBindings
GroupRelay = pytest.importorskip("syncrelay.dataflow.group").GroupRelay
import_type = pytest.importorskip("syncrelay.relay.types").import_type
ReceiveLoop = pytest.importorskip("syncrelay.dataflow.receive").ReceiveLoop

pytestmark = pytest.mark.ros

_TYPES = tuple(f"sensor_msgs/msg/{name}" for name in ("Imu", "MagneticField", "Temperature"))
_NAMES = ("/a", "/b", "/c", "/d", "/e", "/f")
_AT_ONCE = {"reliability": "reliable", "durability": "volatile"}


class _Refusing(entities.Entities):  # type: ignore[name-defined]  # of a module that may be missing
    """Refuses, too, what a test says."""

    def __init__(self, node: Any) -> None:
        super().__init__(node, Purpose.RELAY)
        self.refuses = lambda: False

    def publisher(self, message_type: Any, topic: str, profile: Any) -> Any:
        if self.refuses():
            raise entities.RefusedError(Refusal("publish", topic, "any", why="no more memory"))
        return super().publisher(message_type, topic, profile)


@pytest.fixture(params=BACKENDS)
def here(request, ros_domain: int) -> Iterator[SimpleNamespace]:
    """GroupBindings of a node of this process, with a loop that runs."""
    with in_process.own_node(ros_domain) as own:
        own.backend = choose_backend(request.param, node=own.node, context=own.context)
        port = in_process.port_of(own.node)
        own.entities = _Refusing(port)
        loop = ReceiveLoop(own.backend.inbox(), now=lambda: 0, expire=lambda _: None)
        own.bindings = GroupBindings(entities=own.entities, node=port, backend=own.backend, loop=loop, runtime=SYSTEM)
        thread = Thread(target=loop.run)
        thread.start()
        try:
            yield own
        finally:
            loop.stop()
            thread.join()
            loop.close()


def _groups(**topics: list[tuple[str, str, str]]) -> list[Any]:
    """Groups of these topics, types and outputs."""
    return [GroupRelay(each, now=lambda: 0) for each in _file(**topics).groups]


def _file(**topics: list[tuple[str, str, str]]) -> Config:
    named = {
        name: {
            "policy": "exact_time",
            "topics": [{"topic": a, "type": t, "output": b, "qos": _AT_ONCE} for a, t, b in inputs],
        }
        for name, inputs in topics.items()
    }
    return load_text(config(named))


def _poll(here: SimpleNamespace) -> None:
    for each in here.bindings.topics:
        each.poll()


def _published(here: SimpleNamespace) -> dict[str, str]:
    return {
        each.topic_name: each.msg_type.__name__
        for each in here.node.publishers
        if each.topic_name not in ("/rosout", "/parameter_events")
    }


def _subscribed(here: SimpleNamespace) -> dict[str, str]:
    return {each.topic_name: each.msg_type.__name__ for each in here.node.subscriptions}


def _asked(here: SimpleNamespace) -> tuple[dict[str, str], dict[str, str]]:
    """What the groups that run are to publish and to subscribe to."""
    topics = [topic for group in here.bindings.groups for topic in group.config.topics]
    types = [topic.type.split("/")[-1] for topic in topics]
    return (
        dict(zip([topic.output for topic in topics], types, strict=True)),
        dict(zip([topic.topic for topic in topics], types, strict=True)),
    )


_IMU, _FIELD, _ = _TYPES
_ONE = {"swap": [("/x", _IMU, "/a"), ("/y", _FIELD, "/b")]}


def test_a_topic_that_gives_no_messages_any_more_is_subscribed_anew_and_told(here):
    sources, source = [], here.backend.source

    def noted(*of):
        sources.append(source(*of))
        return sources[-1]

    here.backend.source = noted
    here.bindings.run(_groups(**_ONE))
    _poll(here)
    binding = here.bindings.all[0]
    failing = binding.inputs[0].topic
    publisher = here.node.create_publisher(import_type(_IMU), "/x", 10)
    sources[0].deliver = lambda _: dict[str, object]()["no such"]
    wait_until(lambda: publisher.publish(import_type(_IMU)()) or failing.is_due, "the source to fail")
    # No refusal of rcl's: it is a bug, which whoever looks tells with its traceback.
    with pytest.raises(KeyError):
        failing.poll()
    assert failing.refusal.why == "'no such'"
    assert binding.inputs[1].refusal is None
    assert "/x" not in _subscribed(here)
    failing.try_again()
    failing.poll()
    assert failing.refusal is None
    wait_until(
        lambda: publisher.publish(import_type(_IMU)()) or binding.group.counts()[0].fed > 0,
        "messages of the new source",
    )


def test_a_field_that_a_type_does_not_have_stops_the_one_input_that_asks_for_it(here):
    groups = {"right": [("/x", _IMU, "/a"), ("/y", _IMU, "/b")], "wrong": [("/x", _IMU, "/c"), ("/y", _IMU, "/d")]}
    right, wrong = _groups(**groups)
    first, second = wrong.config.topics
    # As where the type is installed only after the file was checked.
    unread = replace(first, stamp=StampField(field="no.such"))
    wrong = GroupRelay(replace(wrong.config, topics=(unread, second)), now=lambda: 0)
    here.bindings.run([right, wrong])
    publishers = [here.node.create_publisher(import_type(_IMU), name, 10) for name in ("/x", "/y")]
    _poll(here)
    first, second = here.bindings.all
    assert first.waiting_for is None
    assert second.waiting_for == "the field of /x that the file names"
    assert second.inputs[0].output.not_readable.startswith(f"{_IMU} has no usable field no.such: ")
    assert second.inputs[0].topic.is_due
    sent = import_type(_IMU)()

    def fed(group: Any) -> list[bool]:
        return [each.fed > 0 for each in group.counts()]

    wait_until(lambda: [each.publish(sent) for each in publishers] and all(fed(right)), "messages")
    wait_until(lambda: publishers[1].publish(sent) or fed(wrong) == [False, True], "messages of the other input")


_STAYS = [("/s", _IMU, "/so"), ("/t", _FIELD, "/to")]


def _subscriptions(here: SimpleNamespace, file: Config) -> dict[Subscription, Any]:
    """The subscriptions by their keys: one stays where a file has its key again."""
    by_topic = {each.topic_name: each for each in here.node.subscriptions}
    topics = [topic for group in file.groups for topic in group.topics]
    return {Subscription.of(each, topic=each.topic): by_topic[each.topic] for each in topics}


def _any_groups(chance: random.Random) -> dict[str, list[tuple[str, str, str]]]:
    """Groups that make a right file: no topic of theirs has two types, nor comes in and goes out."""
    came = {
        name: _TYPES[place % 3] if chance.random() < 0.8 else chance.choice(_TYPES)
        for place, name in enumerate(_NAMES)
        if chance.random() < 0.7 or place < 2
    }
    outputs = [*sorted(set(_NAMES) - came.keys()), "/g", "/h", "/i", "/j"]
    chance.shuffle(outputs)
    groups: dict[str, list[tuple[str, str, str]]] = {}
    for name in chance.sample(("one", "two", "three"), k=chance.randrange(1, 4)):
        inputs = chance.sample(sorted(came), k=2)
        if len(outputs) >= len(inputs):
            groups[name] = [(each, came[each], outputs.pop()) for each in inputs]
    return groups


@pytest.mark.faults
@pytest.mark.parametrize("seed", range(chosen(short=2, long=20)))
def test_any_groups_take_the_place_of_any_others_or_leave_them_as_they_were(here, seed: int):
    """The entities of the node are those of the groups that run, whatever their topics were before as which types."""
    chance = random.Random(seed)
    # It keeps its topics, and so its publishers and subscriptions.
    running = _file(stays=_STAYS)
    here.bindings.run(_groups(stays=_STAYS))
    _poll(here)
    kept = {id(each) for each in (*here.node.publishers, *here.node.subscriptions)}
    refused = 0
    for _ in range(40):
        before, subscribed = here.bindings.groups, _subscriptions(here, running)
        likelihood = chance.choice([0, 0, 0.1, 0.5])
        here.entities.refuses = lambda likelihood=likelihood: chance.random() < likelihood
        file = _file(stays=_STAYS, **_any_groups(chance))
        kept_names = exchange(running.groups, file.groups).kept
        by_name = {each.config.name: each for each in before}
        asked = [
            by_name[each.name] if each.name in kept_names else GroupRelay(each, now=lambda: 0) for each in file.groups
        ]
        try:
            here.bindings.run(asked)
        except ReloadError:
            refused += 1
            assert here.bindings.groups == before
        else:
            assert here.bindings.groups == asked
            running = file
        _poll(here)
        here.entities.refuses = lambda: False
        for each in here.bindings.topics:
            each.try_again()
        _poll(here)
        assert (_published(here), _subscribed(here)) == _asked(here)
        assert not any(each.missing and "DDS" in each.missing for each in here.bindings.topics)
        assert kept <= {id(each) for each in (*here.node.publishers, *here.node.subscriptions)}
        if running is file:
            now = _subscriptions(here, file)
            assert all(now[key] is each for key, each in subscribed.items() if key in now)
    assert refused
