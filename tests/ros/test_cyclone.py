"""The relay, on Fast DDS, between publishers and subscribers on Cyclone DDS, which use no ROS."""

import json
import random
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import count, product
from typing import Any, NamedTuple

import numpy as np
import pytest

from tests.faults.extent import chosen
from tests.recordings.datasets.drawn_messages import drawn_message
from tests.ros import frames
from tests.ros.cdr_messages import NS_PER_SECOND, STORE, STRING, VECTOR, padded, vector
from tests.ros.configs import config, inputs, outputs
from tests.ros.frames import Frame
from tests.ros.processes import wait_until
from tests.ros.stage import Collector, Stage
from tests.ros.status import ANY_PORT, findings, problems, wait_for_finding
from tests.ros.streams import BEGIN, MS

pytest.importorskip("rclpy", reason="rclpy is not installed")
pytest.importorskip("cyclonedds", reason="cyclonedds is not installed: it is in the extra test")

pytestmark = pytest.mark.ros


class Peer(Collector):
    """A process on Cyclone DDS, see tests/ros/cyclone_peer.py."""

    def __init__(self, stage: Stage, name: str = "cyclone") -> None:
        self.stage = stage
        output = stage.folder / f"{name}.frames"
        output.touch()
        command = [sys.executable, "-m", "tests.ros.cyclone_peer", str(output)]
        super().__init__(stage.start(name, command, stdin=subprocess.PIPE), output)
        self._files = count()

    def do(self, what: str, **keys: Any) -> Any:
        return json.loads(self.process.ask(json.dumps({"do": what, **keys})))

    def write(self, topics: Mapping[str, str], **qos: Any) -> None:
        for topic, type_name in topics.items():
            self.do("write", topic=topic, type=type_name, qos=qos)

    def read(self, topics: Mapping[str, str], **qos: Any) -> None:
        for topic, type_name in topics.items():
            self.do("read", topic=topic, type=type_name, qos=qos)

    def matched(self, topic: str) -> int:
        return int(self.do("matched")[topic])

    def match(self, *topics: str, at_least: int = 1) -> None:
        def are_matched() -> bool:
            numbers = self.do("matched")
            return all(numbers[topic] >= at_least for topic in topics)

        wait_until(are_matched, f"{at_least} on the other side of {', '.join(topics)}")

    def play(self, recording: Sequence[Frame]) -> None:
        path = self.stage.folder / f"{self.process.name}-{next(self._files)}.frames"
        frames.write(path, recording)
        self.do("play", file=str(path), speed=1)


def _message(chance: random.Random, type_name: str, stamp: int, frame_id: str, size: int) -> bytes:
    message = drawn_message(STORE, type_name, chance)
    if hasattr(message, "header"):
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, NS_PER_SECOND)
        message.header.frame_id = frame_id
    if isinstance(getattr(message, "data", None), np.ndarray):
        # Some in one packet, some in many.
        message.data = np.frombuffer(chance.randbytes(size), np.uint8)
    return bytes(STORE.serialize_cdr(message, type_name))


_TYPES = {
    # The trigger is the last to leave.
    "/imu": "sensor_msgs/msg/Imu",
    "/image": "sensor_msgs/msg/Image",
    "/cloud": "sensor_msgs/msg/PointCloud2",
    "/info": "sensor_msgs/msg/CameraInfo",
    "/fix": "sensor_msgs/msg/NavSatFix",
    "/point": "geometry_msgs/msg/PointStamped",
}
_TWO = {topic: _TYPES[topic] for topic in ("/imu", "/point")}
_WORDS = {"/said": STRING, "/heard": STRING}
_POLICIES: Mapping[str, tuple[Mapping[str, str], Mapping[str, Any]]] = {
    "exact_time": (_TYPES, {}),
    "approximate_time": (_TYPES, {"slop": "5ms"}),
    "approximate_time_eager": (_TWO, {"slop": "5ms"}),
    "approximate_epsilon_time": (_TYPES, {"slop": "5ms"}),
    "equal_key": (_TYPES, {"key": "header.frame_id"}),
    "latest_time": (_TYPES, {"trigger": "/point"}),
}


def test_what_cyclone_publishes_reaches_a_subscriber_on_cyclone_byte_for_byte(stage: Stage):
    groups: dict[str, dict[str, Any]] = {
        policy: {"policy": policy, "topics": inputs(topics), **keys} for policy, (topics, keys) in _POLICIES.items()
    }
    groups["ticks"] = {"policy": "latest_time", "trigger": "20 Hz", "topics": inputs(_TWO)}
    groups["receipt"] = {"policy": "latest_time", "trigger": "/heard", "topics": inputs(_WORDS, stamp="receive")}
    relay = stage.relay(config(groups, metrics=ANY_PORT))
    peer = Peer(stage)
    peer.write(_TYPES | _WORDS)
    for name, group in groups.items():
        peer.read({f"/{name}{each['topic']}": each["type"] for each in group["topics"]})
    peer.match(*_TYPES, *_WORDS, *(out for name, group in groups.items() for out in _outputs(name, group)))
    chance, seed_of_sizes = random.Random(1), random.Random(2)
    sent: dict[str, list[bytes]] = {topic: [] for topic in (*_TYPES, *_WORDS)}
    first, recording = set[bytes](), list[Frame]()
    for number in range(chosen(short=6, long=300)):
        stamp = BEGIN + number * 50 * MS
        # The first in several packets is lost between Fast DDS and Cyclone, with rclpy alone too: it is not compared.
        size = seed_of_sizes.choice([7, 3_000, 150_000]) if number else 150_000
        for index, (topic, type_name) in enumerate((_WORDS | _TYPES).items()):
            payload = _message(chance, type_name, stamp, f"moment {number}", size)
            if number:
                sent[topic].append(padded(payload))
            else:
                first.add(padded(payload))
            recording.append(Frame(topic, type_name, stamp + index * MS, payload))
    peer.play(recording)
    for name, group in groups.items():
        for topic, output in zip(_topics(group), _outputs(name, group), strict=True):
            _wait_for_last(peer, name, output, sent[topic])
            received = [each for each in map(padded, peer.payloads(output)) if each not in first]
            if name in ("ticks", "receipt", "latest_time"):
                # Messages of several topics arrive in any order: one may be in two sets, or in none.
                assert set(received) <= set(sent[topic]), (name, topic)
            else:
                assert received == sent[topic][: len(received)], (name, topic)
    assert "Traceback" not in relay.stderr


def _wait_for_last(peer: Peer, name: str, output: str, sent: Sequence[bytes]) -> None:
    """Wait until all has come. The optimal policy keeps what may still get a better partner."""
    last = sent[-2 if name == "approximate_time" else -1]
    if name in ("latest_time", "receipt") and not output.endswith(("/point", "/heard")):
        last = sent[-2]
    peer.process.wait_until(
        lambda: any(padded(each) == last for each in peer.payloads(output)), f"the last message on {output}"
    )


def _topics(group: Mapping[str, Any]) -> list[str]:
    return [each["topic"] for each in group["topics"]]


def _outputs(name: str, group: Mapping[str, Any]) -> list[str]:
    return outputs(name, _topics(group))


class Case(NamedTuple):
    """What Cyclone offers, what the file has, what Cyclone's subscriber requests."""

    offered: Mapping[str, Any]
    qos: Any
    requested: Mapping[str, Any]
    finding: tuple[str, str] | None = None
    """Where nothing gets through: the finding's code, and words of its text."""
    kept: int = 5
    """How many messages are bound to arrive: those that the shallowest history of the way holds."""


_S = NS_PER_SECOND
_BEST_EFFORT = {"reliability": "best_effort"}
_LATCHED = {"durability": "transient_local"}
_BY_TOPIC = {"liveliness": "manual_by_topic", "liveliness_lease_duration": 2 * _S}
_CASES = {
    "reliable": Case({}, "auto", {}),
    "best_effort": Case(_BEST_EFFORT, "auto", _BEST_EFFORT),
    "transient_local": Case(_LATCHED, "auto", _LATCHED),
    "keep_all": Case({"history": "keep_all"}, {"history": "keep_all"}, {"history": "keep_all"}),
    "sensor_data": Case({}, "sensor_data", _BEST_EFFORT),
    # It keeps the last message only: a newer one may replace it before it is sent or taken.
    "system_default": Case({}, "system_default", _LATCHED, kept=1),
    "manual_by_topic": Case(
        _BY_TOPIC,
        {"liveliness": "manual_by_topic", "liveliness_lease_duration": "3s"},
        {"liveliness": "manual_by_topic", "liveliness_lease_duration": 4 * _S},
    ),
    "best_most": Case(
        {**_LATCHED, **_BY_TOPIC, "deadline": 30 * _S}, "best_available", {**_LATCHED, **_BY_TOPIC, "deadline": 30 * _S}
    ),
    "no_reliable": Case(
        _BEST_EFFORT,
        {"reliability": "reliable"},
        {},
        ("incompatible_qos", "reliability best_effort, the group requests reliable"),
    ),
    "no_manual_by_topic": Case(
        {"liveliness": "manual_by_participant"},
        {"liveliness": "manual_by_topic"},
        {},
        ("incompatible_qos", "liveliness unknown, the group requests manual_by_topic"),
    ),
    "not_heard": Case(_BEST_EFFORT, "auto", {}, ("subscriber_qos", "reliability reliable, the relay offers best_eff")),
}


def test_each_qos_connects_to_cyclone_or_is_said_not_to(stage: Stage):
    groups = {
        name: {"policy": "exact_time", "topics": inputs(_pair(name), qos=case.qos)} for name, case in _CASES.items()
    }
    relay = stage.relay(config(groups, metrics=ANY_PORT))
    peer = Peer(stage)
    open_ = {name: case for name, case in _CASES.items() if case.finding is None}
    refused = {name: case for name, case in _CASES.items() if case.finding is not None}
    # All publishers come later than the relay.
    relay.wait_for_log("status and metrics")
    for name, case in _CASES.items():
        peer.write(_pair(name), **case.offered)
        if name != "transient_local":
            peer.read(_out(name), **case.requested)
    live = {name: [*_pair(name), *(() if name == "transient_local" else _out(name))] for name in open_}
    peer.match(*(topic for topics in live.values() for topic in topics))
    first = _play_until_all_connect(peer, live)
    peer.play(_moments(*_CASES, number=5, first=first))
    # A subscriber that is late gets what was latched.
    peer.read(_out("transient_local"), **_CASES["transient_local"].requested)
    for name, case in open_.items():
        sent = _moments(name, number=5, first=first)
        for topic, output in zip(_pair(name), _out(name), strict=True):
            wanted = [frame.payload for frame in sent if frame.topic == topic][-case.kept :]
            peer.process.wait_until(partial(_ends_with, peer, output, wanted), f"the last of {name} on {output}")
        assert not problems(relay, name) & {"incompatible_qos", "subscriber_qos"}, name
    for name, case in refused.items():
        assert case.finding is not None
        code, words = case.finding
        wait_for_finding(relay, code, name, naming=[words, "without ROS"])
        closed = _out(name) if code == "subscriber_qos" else _pair(name)
        assert [peer.matched(topic) for topic in closed] == [0, 0], name
        assert peer.count(next(iter(_out(name)))) == 0


def _play_until_all_connect(peer: Peer, live: Mapping[str, Sequence[str]]) -> int:
    """The number of the next moment. That Cyclone has matched does not say that Fast DDS has."""
    numbers = count()
    outputs_of_live = [topic for name, topics in live.items() for topic in topics if topic in _out(name)]

    def connected() -> bool:
        peer.play(_moments(*_CASES, number=1, first=next(numbers)))
        return all(peer.count(topic) for topic in outputs_of_live)

    wait_until(connected, "a set of each group")
    return next(numbers)


def _ends_with(peer: Peer, output: str, wanted: Sequence[bytes]) -> bool:
    return peer.payloads(output)[-len(wanted) :] == wanted


def _pair(name: str) -> dict[str, str]:
    return dict.fromkeys([f"/{name}/left", f"/{name}/right"], VECTOR)


def _out(name: str) -> dict[str, str]:
    return dict.fromkeys(outputs(name, _pair(name)), VECTOR)


def _moments(*names: str, number: int, first: int = 0) -> list[Frame]:
    """Messages of pairs, moment after moment at 20 Hz."""
    stamps = [BEGIN + n * 50 * MS for n in range(first, first + number)]
    return [Frame(topic, VECTOR, stamp, vector(stamp)) for stamp in stamps for name in names for topic in _pair(name)]


@pytest.mark.skipif(chosen(short=True, long=False), reason="the long form, `make faults`, has it")
def test_of_drawn_qos_the_relay_says_of_each_what_cyclone_finds(stage: Stage):
    offers = list(_all_qos(manual="manual_by_participant"))
    chance = random.Random(5)
    cases = {f"g{n}": (chance.choice(offers), chance.choice(offers)) for n in range(60)}
    groups = {}
    for name, (_, asked) in cases.items():
        qos = {key: f"{value}ns" if isinstance(value, int) else value for key, value in asked.items()}
        if qos.get("liveliness") == "manual_by_participant":
            qos["liveliness"] = "automatic"
        groups[name] = {"policy": "exact_time", "topics": inputs(_pair(name), qos=qos)}
    relay = stage.relay(config(groups, metrics=ANY_PORT))
    peer = Peer(stage)
    for name, (offered, _) in cases.items():
        peer.write(_pair(name), **offered)

    def agree(name: str) -> bool:
        peer.play(_moments(name, number=1, first=next(numbers)))
        said = "incompatible_qos" in findings(relay, name)
        return said is (peer.matched(f"/{name}/left") == 0) and bool(
            said or "no_publisher" not in problems(relay, name)
        )

    numbers = count()
    for name, case in cases.items():
        wait_until(partial(agree, name), f"what Cyclone finds of {case}", deadline_s=60)


def _all_qos(*, manual: str) -> Iterator[dict[str, Any]]:
    for reliability, durability, liveliness, lease, deadline in product(
        ("reliable", "best_effort"),
        ("volatile", "transient_local"),
        ("automatic", "manual_by_topic", manual),
        (None, 2 * _S, 9 * _S),
        (None, 3 * _S, 8 * _S),
    ):
        keys = {"liveliness_lease_duration": lease, "deadline": deadline}
        named = {"reliability": reliability, "durability": durability, "liveliness": liveliness}
        yield named | {key: value for key, value in keys.items() if value is not None}
