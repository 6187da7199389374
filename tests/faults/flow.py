"""Sources, witnesses and a relay between them, of one group of certified messages."""

import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs
from tests.ros.processes import DEADLINE_S, Process, wait_until
from tests.ros.stage import Stage
from tests.ros.status import ANY_PORT, status

MS = 1_000_000

_CONFIGS = Path(__file__).parents[2] / "configs"


@dataclass(frozen=True, slots=True)
class Report:
    """What a witness has seen. `last_set` is the stamp of the last set that came whole."""

    messages: list[int]
    sets: int
    unpaired: int
    last_set: int | None
    faults: list[str]


class Source:
    """Publishes certified messages; see tests.faults.source."""

    def __init__(self, process: Process) -> None:
        self.process = process

    def match(self, subscriptions: int = 1) -> None:
        self.process.ask(f"match {subscriptions}")

    def pace(self, hz: float) -> list[int]:
        """Publish at this rate from now on; how many messages were published on each topic until then."""
        return list(json.loads(self.process.ask(f"pace {hz}")))

    def settle(self) -> bool:
        """Whether all that was published is acknowledged."""
        return bool(json.loads(self.process.ask("settle")))


class Witness:
    """Holds what comes out to the law; see tests.faults.witness."""

    def __init__(self, process: Process) -> None:
        self.process = process

    def match(self) -> None:
        self.process.ask("match")

    def report(self) -> Report:
        return Report(**json.loads(self.process.ask("report")))

    def wait_for_sets(self, more: int, *, deadline_s: float = DEADLINE_S) -> Report:
        """What it has seen as soon as it has seen so many more sets than now."""
        enough = self.report().sets + more
        self.process.wait_until(lambda: self.report().sets >= enough, f"{more} more sets", deadline_s=deadline_s)
        return self.report()

    def wait_for_set_after(self, stamp: int, *, deadline_s: float = DEADLINE_S) -> Report:
        """What it has seen as soon as a set came that is stamped later than this."""
        self.process.wait_until(
            lambda: (self.report().last_set or 0) > stamp, f"a set after {stamp}", deadline_s=deadline_s
        )
        return self.report()


@dataclass(frozen=True, slots=True)
class Rig:
    """One group, `front`, of topics that are published alike. Times in nanoseconds.

    `before` are words to put before each command, such as those that start it in another namespace.
    """

    stage: Stage
    topics: tuple[str, ...] = ("/camera", "/lidar")
    slop: int = 4 * MS
    before: tuple[str, ...] = ()

    def relay(self, *, keys: Mapping[str, Any] | None = None, qos: Mapping[str, Any] | None = None) -> Process:
        """A relay of the group with these keys, whose inputs have this QoS."""
        topics = inputs(dict.fromkeys(self.topics, VECTOR), **({"qos": qos} if qos else {}))
        group = {
            "policy": "approximate_time",
            "slop": f"{self.slop}ns",
            "queue_size": 50,
            "restamp": "earliest",
            **(keys or {}),
            "topics": topics,
        }
        return self.stage.relay(config({"front": group}, metrics=ANY_PORT), before=self.before)

    def source(self, *topics: str, node: str = "source", **options: Any) -> Source:
        """A process that publishes on these topics, on all of the group if none are named."""
        named = [word for topic in topics or self.topics for word in ("--topic", topic)]
        argv = [*named, f"--node={node}", f"--jitter={self.slop // 2}", *_options(options)]
        return Source(self._start("source", argv))

    def witness(self, *, node: str = "witness", **options: Any) -> Witness:
        """A process that checks what comes out of the group."""
        outputs = [word for topic in self.topics for word in ("--output", topic, f"/front{topic}")]
        argv = [*outputs, f"--node={node}", f"--slop={self.slop}"]
        return Witness(self._start("witness", [*argv, *_options(options)]))

    def _start(self, name: str, argv: Sequence[str]) -> Process:
        words = [*self.before, sys.executable, "-m", f"tests.faults.{name}", *argv]
        return self.stage.start(name, words, stdin=subprocess.PIPE)


def _options(options: Mapping[str, Any]) -> list[str]:
    return [f"--{name}={value}" for name, value in options.items()]


# Neither memory nor network is shared with anybody. rmw_fastrtps has transports of its own for the discovery range
# LOCALHOST, shared memory among them, whatever a profile says.
_UDP_OVER_LOOPBACK = """\
<?xml version="1.0" encoding="UTF-8"?>
<profiles xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <transport_descriptors><transport_descriptor>
    <transport_id>loopback</transport_id><type>UDPv4</type>
    <interfaceWhiteList><address>127.0.0.1</address></interfaceWhiteList>
  </transport_descriptor></transport_descriptors>
  <participant profile_name="loopback" is_default_profile="true"><rtps>
    <userTransports><transport_id>loopback</transport_id></userTransports>
    <useBuiltinTransports>false</useBuiltinTransports>
  </rtps></participant>
</profiles>
"""


def without_shared_memory(stage: Stage) -> None:
    """Have all processes of a stage speak over UDP, as they do across machines and in containers."""
    profile = stage.folder / "loopback.xml"
    profile.write_text(_UDP_OVER_LOOPBACK)
    stage.environment |= {"FASTRTPS_DEFAULT_PROFILES_FILE": str(profile), "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}


WAYS = ("reliable", "reliable, fast_heartbeats", "best_effort")


def go_way(stage: Stage, way: str) -> str:
    """Have a stage publish in one of WAYS; its reliability, for sources and witnesses."""
    reliability, _, profile = way.partition(", ")
    if profile:
        stage.environment["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(_CONFIGS / f"{profile}.xml")
    return reliability


def accounts(relay: Process, group: str = "front") -> list[dict[str, Any]]:
    """The inputs of a group as /status has them, each of which accounts for every message that came in."""
    listed = {each["name"]: each["inputs"] for each in status(relay)["groups"]}.get(group, [])
    for each in listed:
        account = each["matched"] + sum(each["dropped"].values()) + each["buffered"]
        assert each["received"] == account, each
    return list(listed)


def wait_until_received(relay: Process, counts: Sequence[int], group: str = "front") -> list[dict[str, Any]]:
    """The accounts as soon as each input has received so many messages; they are a second old at most."""
    wait_until(
        lambda: [each["received"] for each in accounts(relay, group)] == list(counts), f"{counts} messages of {group}"
    )
    return accounts(relay, group)
