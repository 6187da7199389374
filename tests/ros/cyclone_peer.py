"""A process that publishes and subscribes by Cyclone DDS, without ROS. Run as `python -m tests.ros.cyclone_peer FILE`.

What it receives goes to FILE as frames.py writes it. It takes JSON objects on stdin, one a line, and answers each with
a line of JSON on stdout when it is done:

    {"do": "write", "topic": T, "type": N, "qos": Q}    there is a writer of ROS's topic T, of ROS's type N
    {"do": "read", "topic": T, "type": N, "qos": Q}     there is a reader
    {"do": "matched"}                                   how many readers each writer has, how many writers each reader
    {"do": "play", "file": F, "speed": S}               the frames of F were published, paced by their times

Q has the keys of a `qos` in a file, with durations in nanoseconds. It ends when stdin does.
"""

import json
import os
import sys
import threading
import time
import types
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

# DDS of ROS finds others on this machine alone by asking these addresses. Without hashes of keys Fast DDS does not
# notice that a reader or writer ends before its process.
os.environ["CYCLONEDDS_URI"] = """
<CycloneDDS><Domain Id="any">
  <General>
    <Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces><AllowMulticast>false</AllowMulticast>
  </General>
  <Discovery>
    <ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>
    <Peers><Peer address="127.0.0.1"/></Peers><LeaseDuration>3s</LeaseDuration>
  </Discovery>
  <Internal><GenerateKeyhash>true</GenerateKeyhash></Internal>
</Domain></CycloneDDS>"""

from cyclonedds._clayer import ddspy_take
from cyclonedds.core import InstanceState, SampleState, ViewState
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl import types as idl
from cyclonedds.idl.annotations import final
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration
from rosbags.interfaces import Nodetype

from tests.ros import frames
from tests.ros.cdr_messages import STORE

_POLL_S = 0.005
_ANY = SampleState.Any | ViewState.Any | InstanceState.Any
_ENDLESS = duration(infinite=True)
_STRUCTS: dict[str, Any] = {}


def struct_of(name: str) -> Any:
    """The class by which Cyclone knows a type of ROS."""
    if name not in _STRUCTS:
        package, kind, short = name.split("/")
        fields = {field: _annotation(*of) for field, of in STORE.fielddefs[name][1]}
        full = f"{package}::{kind}::dds_::{short}_"
        made = types.new_class(
            short, (IdlStruct,), {"typename": full}, lambda body: body.update(__annotations__=fields)
        )
        made.__module__ = __name__
        _STRUCTS[name] = final(dataclass(made))
    return _STRUCTS[name]


def _annotation(kind: Nodetype, of: Any) -> Any:
    if kind is Nodetype.NAME:
        return struct_of(of)
    if kind is Nodetype.BASE:
        return {"bool": bool, "string": str}.get(of[0]) or getattr(idl, of[0])
    element = _annotation(*of[0])
    return idl.array[element, of[1]] if kind is Nodetype.ARRAY else idl.sequence[element]


def qos_of(asked: dict[str, Any]) -> Qos:
    """Cyclone's QoS by the keys of a file."""
    lease = asked.get("liveliness_lease_duration") or _ENDLESS
    kept = asked.get("history") == "keep_all"
    policies = [
        Policy.DataRepresentation(use_cdrv0_representation=True),
        Policy.History.KeepAll if kept else Policy.History.KeepLast(asked.get("depth", 1000)),
        {
            "best_effort": Policy.Reliability.BestEffort,
            "reliable": Policy.Reliability.Reliable(duration(seconds=1)),
        }[asked.get("reliability", "reliable")],
        {
            "volatile": Policy.Durability.Volatile,
            "transient_local": Policy.Durability.TransientLocal,
        }[asked.get("durability", "volatile")],
        {
            "automatic": Policy.Liveliness.Automatic(lease),
            "manual_by_participant": Policy.Liveliness.ManualByParticipant(lease),
            "manual_by_topic": Policy.Liveliness.ManualByTopic(lease),
        }[asked.get("liveliness", "automatic")],
    ]
    if asked.get("deadline"):
        policies.append(Policy.Deadline(asked["deadline"]))
    if asked.get("lifespan"):
        policies.append(Policy.Lifespan(asked["lifespan"]))
    return Qos(*policies)


@dataclass
class Peer:
    """All that this process has on DDS."""

    participant: DomainParticipant
    output: BinaryIO
    writers: dict[str, DataWriter] = field(default_factory=dict)
    readers: dict[str, DataReader] = field(default_factory=dict)
    kinds: dict[str, str] = field(default_factory=dict)
    """The types of the topics."""
    lock: threading.Lock = field(default_factory=threading.Lock)
    ended: threading.Event = field(default_factory=threading.Event)

    def answer(self, asked: dict[str, Any]) -> object:
        match asked["do"]:
            case "write" | "read" as side:
                self._open(side, asked["topic"], asked["type"], qos_of(asked["qos"]))
            case "matched":
                readers = {topic: len(each.get_matched_subscriptions()) for topic, each in self.writers.items()}
                return readers | {topic: len(each.get_matched_publications()) for topic, each in self.readers.items()}
            case "play":
                self._play(frames.read(Path(asked["file"])), asked["speed"])
        return None

    def _open(self, side: str, name: str, type_name: str, qos: Qos) -> None:
        topic = Topic(self.participant, f"rt{name}", struct_of(type_name))
        self.kinds[name] = type_name
        with self.lock:
            if side == "write":
                self.writers[name] = DataWriter(self.participant, topic, qos=qos)
            else:
                self.readers[name] = DataReader(self.participant, topic, qos=qos)

    def _play(self, recording: list[frames.Frame], speed: float) -> None:
        began = time.monotonic()
        for frame in recording:
            due = began + (frame.time - recording[0].time) / 1e9 / speed
            time.sleep(max(0, due - time.monotonic()))
            # Cyclone reads and writes it: what leaves here are its own bytes.
            self.writers[frame.topic].write(struct_of(frame.type_name).deserialize(frame.payload))

    def receive(self) -> None:
        while not self.ended.wait(_POLL_S):
            self._take()

    def _take(self) -> None:
        # By itself: a name that still held a reader would keep it from ending.
        with self.lock:
            for topic, reader in self.readers.items():
                # The bytes as they came, which the reader's own methods do not give.
                for content, info in ddspy_take(reader._ref, _ANY, 1000):  # noqa: SLF001
                    if info.valid_data:
                        frame = frames.Frame(topic, self.kinds[topic], time.time_ns(), bytes(content))
                        frames.append(self.output, frame)


def main() -> None:
    with Path(sys.argv[1]).open("wb", buffering=0) as output:
        peer = Peer(DomainParticipant(int(os.environ["ROS_DOMAIN_ID"])), output)
        receiving = threading.Thread(target=peer.receive)
        receiving.start()
        for line in sys.stdin:
            print(json.dumps(peer.answer(json.loads(line))), flush=True)  # noqa: T201  the answer
        peer.ended.set()
        receiving.join()


if __name__ == "__main__":
    main()
