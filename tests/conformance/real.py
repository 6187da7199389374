"""Real Fast DDS: a participant for each process of a script, within the test's process and kept for the next script."""

import faulthandler
import os
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Final
from unittest.mock import patch

import rclpy
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.event_handler import PublisherEventCallbacks

from syncrelay.config.profile import Profile
from syncrelay.relay.ports import Node, Purpose
from syncrelay.relay.types import import_type
from syncrelay.ros.graph import RosGraph
from syncrelay.ros.joining import joined
from syncrelay.ros.leaving import is_leaving
from syncrelay.ros.qos import to_rclpy
from syncrelay.runtime import SYSTEM
from tests.conformance.player import play
from tests.conformance.scripts import SCRIPTS
from tests.faults.extent import chosen
from tests.ros.caller import Caller
from tests.ros.domain import claimed_domain
from tests.ros.frames import Frame
from tests.ros.processes import wait_until
from tests.ros.stage import BACKEND, Player, Stage

_MORTAL: Final = "mortal"
"""Who is to be killed has a process of its own."""


class _Writer:
    def __init__(self, node: Any, message_type: Any, topic: str, profile: Profile) -> None:
        self._node = node
        self._raw = node.create_publisher(message_type, topic, to_rclpy(profile))

    @property
    def n_readers(self) -> int:
        return int(self._raw.get_subscription_count())

    def write(self, content: bytes) -> None:
        self._raw.publish(content)

    def end(self) -> None:
        self._node.destroy_publisher(self._raw)


class _MortalWriter:
    """A publisher of a process that can be killed."""

    def __init__(self, player: Player, topic: str, type_name: str) -> None:
        self.player = player
        self._topic, self._type = topic, type_name

    @property
    def n_readers(self) -> int:
        self.player.match(1)
        return 1

    def write(self, content: bytes) -> None:
        self.player.play([Frame(self._topic, self._type, 0, content)])

    def end(self) -> None:
        self.player.process.ask_to_end()


class _Reader:
    def __init__(self, node: Any, message_type: Any, topic: str, profile: Profile) -> None:
        self._node = node
        self._type = message_type
        self._raw = node.create_subscription(message_type, topic, print, to_rclpy(profile), raw=True)

    @property
    def n_writers(self) -> int:
        return int(self._raw.get_publisher_count())

    def take(self) -> bytes | None:
        taken = self._raw.handle.take_message(self._type, True)  # noqa: FBT003  rclpy's signature
        return None if taken is None else bytes(taken[0])

    def end(self) -> None:
        self._node.destroy_subscription(self._raw)


class RealWorld:
    """A domain, for one script after another."""

    left = ()

    def __init__(self, domain: int, folder: Path, environment: Mapping[str, str]) -> None:
        self.runtime = SYSTEM
        self._domain, self._folder, self._environment = domain, folder, environment
        self._caller = Caller("/syncrelay", domain=domain, environment=environment)
        # Who looks at the graph has found what the rig has: one more participant might find it 3 s later.
        self._contexts: dict[str, Any] = {"rig": self._caller.node.context}
        self._nodes: dict[tuple[str, str], Any] = {}
        self.graph = RosGraph(self._caller.node)
        self._stage = Stage(folder, domain, BACKEND)
        self._mortals: dict[str, list[Player]] = {}

    def writer(self, topic: str, type_name: str, profile: Profile, *, by: str, node: str) -> Any:
        if by.startswith(_MORTAL):
            player = self._stage.player(
                {topic: type_name}, node=node, reliability=profile.reliability, durability=profile.durability
            )
            self._mortals.setdefault(by, []).append(player)
            player.is_up()
            return _MortalWriter(player, topic, type_name)
        return _Writer(self._node(by, node), import_type(type_name), topic, profile)

    def reader(self, topic: str, type_name: str, profile: Profile, *, by: str, node: str) -> _Reader:
        return _Reader(self._node(by, node), import_type(type_name), topic, profile)

    def _node(self, by: str, name: str) -> Any:
        if (by, name) not in self._nodes:
            if by not in self._contexts:
                self._contexts[by] = rclpy.context.Context()
                rclpy.init(
                    context=self._contexts[by],
                    domain_id=self._domain,
                    args=["--ros-args", "--disable-external-lib-logs"],
                )
            self._nodes[by, name] = rclpy.create_node(
                name.rpartition("/")[2],
                namespace=name.rpartition("/")[0] or "/",
                context=self._contexts[by],
                enable_rosout=False,
                start_parameter_services=False,
            )
        return self._nodes[by, name]

    def leave(self, by: str) -> None:
        for player in self._mortals.pop(by, ()):
            player.process.ask_to_end()
        for key in [each for each in self._nodes if each[0] == by]:
            self._nodes.pop(key).destroy_node()
        if by in self._contexts:
            self._contexts.pop(by).try_shutdown()

    def kill(self, by: str) -> None:
        for player in self._mortals.pop(by):
            os.kill(player.process.pid, 9)
            player.process.wait()

    def join(self, config: Any, names: Mapping[str, str], purpose: Purpose = Purpose.RELAY) -> tuple[Any, Any]:
        ros_args = [word for old, new in names.items() for word in ("-r", f"{old}:={new}")]
        return joined(config, ros_args=ros_args, purpose=purpose, is_managed=config.node.lifecycle)

    def hold(self, node: Any, topic: str, type_name: str) -> object:
        # One that tells of events is in the executor, and may not end while that waits.
        silent = PublisherEventCallbacks(use_default_callbacks=False)
        return node.raw.create_publisher(import_type(type_name), topic, 1, event_callbacks=silent)

    def free(self, node: Any, held: object) -> None:
        node.raw.destroy_publisher(held)

    def wait_until(self, condition: Callable[[], object], what: str) -> None:
        wait_until(condition, what, deadline_s=60, poll_s=0.01)

    def call(self, node: Node, service: str) -> tuple[bool, str]:
        self._caller.called = node.name
        return self._caller.call(service)

    def transition(self, node: Node, name: str) -> tuple[bool, str]:
        self._caller.called = node.name
        success = self._caller.ask(ChangeState, "change_state", transition=Transition(label=name)).success
        return bool(success), str(self._caller.ask(GetState, "get_state").current_state.label)

    def clear(self) -> None:
        """End all but the participants, and wait until nothing of it is in the graph."""
        for node in self._nodes.values():
            node.destroy_node()
        self._nodes.clear()
        for by in list(self._mortals):
            self.leave(by)
        wait_until(lambda: len(self.graph.nodes()) == 1, "the others to go")

    def close(self) -> None:
        for by in [each for each in self._contexts if each != "rig"]:
            self.leave(by)
        self._caller.close()
        self._stage.end()


# As between processes of their own: within one, Fast DDS would hand messages over without sending them.
_PROFILE: Final = """<?xml version="1.0" encoding="UTF-8" ?>
<dds xmlns="http://www.eprosima.com">
  <library_settings><intraprocess_delivery>OFF</intraprocess_delivery></library_settings>
  {}
</dds>
"""
# Participants that announce themselves every 3 s, as usual, may find each other that late: the short form has no time.
_OFTEN: Final = """
  <profiles><participant profile_name="often" is_default_profile="true"><rtps><builtin><discovery_config>
    <leaseAnnouncement><sec>0</sec><nanosec>200000000</nanosec></leaseAnnouncement>
  </discovery_config></builtin></rtps></participant></profiles>"""


@contextmanager
def real_world(folder: Path) -> Iterator[RealWorld]:
    """A real ROS on a domain of its own, in a process that has not used DDS before."""
    profile = folder / "profile.xml"
    profile.write_text(_PROFILE.format(chosen(short=_OFTEN, long="")))
    with claimed_domain() as domain:
        environment = {
            "ROS_DOMAIN_ID": str(domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_LOG_DIR": str(folder),
            "SYNCRELAY_RECEIVE": BACKEND,
            "FASTRTPS_DEFAULT_PROFILES_FILE": str(profile),
        }
        with patch.dict(os.environ, environment):
            world = RealWorld(domain, folder, environment)
            try:
                yield world
            finally:
                world.close()


def serve(asked: Connection, folder: Path) -> None:
    """Play scripts in a process of their own: by their titles, with folders for their files, until None comes.

    Each answer comes with whether it is the last. The next script may not see what hangs in Fast DDS.
    """
    with real_world(folder) as world:
        while (words := asked.recv()) is not None:
            title, own = words
            script = next(each for each in SCRIPTS if each.title == title)
            try:
                answer = play(script, world, own)
                if not is_leaving():
                    world.clear()
                asked.send((answer, is_leaving()))
            except Exception:  # noqa: BLE001  it is raised where the test can see it
                # What goes on in other threads tells why something does not end.
                faulthandler.dump_traceback()
                asked.send((traceback.format_exc(), True))
