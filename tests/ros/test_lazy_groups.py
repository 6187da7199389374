"""Lazy groups: they receive while somebody listens, and only then."""

import re

import pytest

from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs
from tests.ros.frames import Frame
from tests.ros.processes import Process, wait_until
from tests.ros.reloaded import ReloadedFile
from tests.ros.sensors import OF_A_BUSY_MACHINE
from tests.ros.stage import Collector, Stage, both_backends
from tests.ros.status import ANY_PORT, findings, first_group, page, status, wait_for_finding
from tests.ros.streams import at, merged

pytestmark = pytest.mark.ros

_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
_LAZY = {"policy": "approximate_time", "slop": "20ms", "lazy": True, "topics": inputs(_PAIR)}
_WAITS = "front: waiting for a subscriber of /front/camera or /front/lidar"
_RUNS = "front: running: /camera -> /front/camera, /lidar -> /front/lidar"


def _stream(*topics: str) -> list[Frame]:
    """Ten minutes at 20 Hz: longer than any test listens."""
    return merged(*(at(topic, *range(0, 600_000, 50)) for topic in topics))


def _subscribed(observer: Collector, topic: str = "/camera") -> bool:
    return bool(observer.endpoints(topic, kind="subscription", node="/syncrelay"))


def _received(relay: Process, group: str) -> int:
    """How many messages of its first input a group has received; 0 of one that was not looked at yet."""
    return sum(each["inputs"][0]["received"] for each in status(relay)["groups"] if each["name"] == group)


def _said_of_groups(relay: Process) -> list[str]:
    """What the log says of how groups run, without times and levels; but for publishers that were found late."""
    return re.findall(r"(?:front|rear): (?:waiting for a subscriber|running).*", relay.stderr)


@both_backends
def test_a_lazy_group_receives_only_while_somebody_listens(stage: Stage):
    observer, player = stage.collector(node="observer"), stage.player(_PAIR)
    player.start(_stream(*_PAIR), speed=1)
    relay = stage.relay(config({"front": _LAZY}, metrics=ANY_PORT))
    relay.wait_for_log(_WAITS)
    # It offers its outputs all the same, and is ready.
    wait_until(lambda: observer.endpoints("/front/lidar", kind="publisher", node="/syncrelay"), "the outputs")
    wait_for_finding(relay, "nobody_listens", naming=["/front/camera", "/front/lidar"])
    wait_until(lambda: first_group(relay)["level"] == "ok", "a group in order")
    wait_until(lambda: page(relay, "/readyz") == (200, "ready\n"), "a relay that is ready")
    assert not _subscribed(observer)
    for _ in range(2):
        listener = stage.collector({"/front/lidar": VECTOR})
        listener.wait_for("/front/lidar", 20)
        wait_until(lambda: _subscribed(observer), "the inputs")
        wait_until(lambda: "nobody_listens" not in findings(relay), "the group to be awake")
        listener.process.ask_to_end()
        wait_until(lambda: not _subscribed(observer) and not _subscribed(observer, "/lidar"), "the end of the inputs")
        wait_for_finding(relay, "nobody_listens")
    for each in first_group(relay)["inputs"]:
        assert each["buffered"] == 0
        assert each["received"] == each["matched"] + sum(each["dropped"].values())
    assert _said_of_groups(relay) == [_WAITS, _RUNS, _WAITS, _RUNS, _WAITS]


def test_a_sleeping_group_gets_nothing_of_a_topic_that_another_group_receives(stage: Stage):
    observer, player = stage.collector(node="observer"), stage.player(_PAIR)
    player.start(_stream(*_PAIR), speed=1)
    rear = {"policy": "exact_time", "topics": inputs(_PAIR)}
    file = ReloadedFile(stage, front=_LAZY, rear=rear)
    wait_until(lambda: _received(file.relay, "rear") >= 20, "messages of the group that is awake")
    assert _received(file.relay, "front") == 0
    listener = stage.collector({"/front/lidar": VECTOR})
    listener.wait_for("/front/lidar", 20)
    wait_until(
        lambda: len(observer.endpoints("/camera", kind="subscription", node="/syncrelay")) == 1, "one subscription"
    )
    file.reload(front={**_LAZY, "lazy": False})
    file.reload(front=_LAZY)
    # The outputs keep their subscriber, and the group does not sleep for a moment.
    listener.wait_for("/front/lidar", listener.count("/front/lidar") + 20)
    assert _WAITS not in file.relay.stderr.split("reloaded")[-1]
    listener.process.ask_to_end()
    wait_until(lambda: not _subscribed(observer), "the end of the inputs")
    file.reload(front={**_LAZY, "lazy": False})
    wait_until(lambda: _received(file.relay, "front") >= 20, "messages of the group that is lazy no more")


def test_a_sleeping_group_offers_what_its_publishers_offer_now(stage: Stage):
    observer = stage.collector(node="observer")
    relay = stage.relay(config({"front": _LAZY}, metrics=ANY_PORT))
    wait_for_finding(relay, "no_publisher")
    for reliability in ("reliable", "best_effort"):
        player = stage.player(_PAIR, node=reliability, reliability=reliability)
        wait_until(lambda offered=reliability: _offered(observer) == [offered], "the QoS of the publishers")
    assert not _subscribed(observer)
    wait_until(lambda: findings(relay).keys() - OF_A_BUSY_MACHINE == {"nobody_listens"}, "no other finding")
    listener = stage.collector({"/front/lidar": VECTOR}, reliability="best_effort")
    player.match()
    player.start(_stream(*_PAIR), speed=1)
    listener.wait_for("/front/lidar", 5)


def _offered(observer: Collector) -> list[str]:
    return [each["reliability"] for each in observer.endpoints("/front/lidar", kind="publisher")]
