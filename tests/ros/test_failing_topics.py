"""Topics that give no messages, or none that a group can use: their groups are told, and others go on."""

from collections.abc import Iterator
from dataclasses import replace
from threading import Thread
from types import SimpleNamespace
from typing import Any

import pytest

from syncrelay.config import Config, StampField, load_text
from syncrelay.relay.ports import Purpose
from syncrelay.runtime import SYSTEM
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

_IMU, _FIELD = (f"sensor_msgs/msg/{name}" for name in ("Imu", "MagneticField"))
_AT_ONCE = {"reliability": "reliable", "durability": "volatile"}


@pytest.fixture(params=BACKENDS)
def here(request, ros_domain: int) -> Iterator[SimpleNamespace]:
    """GroupBindings of a node of this process, with a loop that runs."""
    with in_process.own_node(ros_domain) as own:
        own.backend = choose_backend(request.param, node=own.node, context=own.context)
        port = in_process.port_of(own.node)
        own.entities = entities.Entities(port, Purpose.RELAY)
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


def _subscribed(here: SimpleNamespace) -> dict[str, str]:
    return {each.topic_name: each.msg_type.__name__ for each in here.node.subscriptions}


def test_a_topic_that_gives_no_messages_any_more_is_subscribed_anew_and_told(here):
    sources, source = [], here.backend.source

    def noted(*of):
        sources.append(source(*of))
        return sources[-1]

    here.backend.source = noted
    here.bindings.run(_groups(swap=[("/x", _IMU, "/a"), ("/y", _FIELD, "/b")]))
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
