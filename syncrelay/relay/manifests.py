"""The publishers of manifests, one a group, which outlive the group where a reload puts another in its place."""

import logging
from collections.abc import Iterable
from typing import Final

from diagnostic_msgs.msg import DiagnosticArray

from syncrelay.config.names_in_graph import manifest_topic
from syncrelay.config.profile import Profile
from syncrelay.dataflow.backend import Outlet, RclBackend
from syncrelay.dataflow.bugs import Bugs, OnceLog
from syncrelay.dataflow.group import GroupRelay
from syncrelay.dataflow.manifest import MANIFEST_DEPTH, ManifestWriter
from syncrelay.dataflow.manifest_queue import GroupManifests, ManifestQueue
from syncrelay.dataflow.receive import ReceiveLoop
from syncrelay.relay.entities import Entities, RefusedError
from syncrelay.relay.ports import Node, Publisher, Purpose
from syncrelay.runtime import Runtime

_PROFILE: Final = Profile(depth=MANIFEST_DEPTH)


class Manifests:
    """Has the manifests of groups' sets published, on the thread that runs `queue`. On the main thread."""

    def __init__(
        self,
        *,
        entities: Entities,
        node: Node,
        backend: RclBackend,
        loop: ReceiveLoop,
        bugs: Bugs,
        runtime: Runtime,
    ) -> None:
        self.queue = ManifestQueue(bugs=bugs, runtime=runtime)
        self._runtime = runtime
        self._entities = entities
        self._node = node
        self._backend = backend
        self._loop = loop
        self._publishers: dict[str, tuple[Publisher, Outlet]] = {}
        self._begun: dict[GroupRelay, GroupManifests] = {}
        self._once = OnceLog()

    def begin(self, groups: Iterable[GroupRelay]) -> None:
        """Have these groups publish manifests, from their first set on if they do not run yet.

        If DDS refuses a publisher, that is logged once, and the group runs without manifests.
        """
        for group in groups:
            if self._is_wanted(group) and group not in self._begun:
                try:
                    outlet = self._outlet(group.config.name)
                except RefusedError as error:
                    self._once.log(logging.WARNING, str(error))
                else:
                    self._connect(group, outlet)

    def end_others(self, groups: Iterable[GroupRelay]) -> None:
        """Publish all manifests, then end the publishers that none of these groups needs; no other group may run."""
        self._begun = {group: self._begun[group] for group in groups if group in self._begun}
        self.queue.keep(self._begun.values())
        wanted = {group.config.name for group in groups if self._is_wanted(group)}
        for name in [name for name in self._publishers if name not in wanted]:
            self._entities.end(self._publishers.pop(name)[0])

    def publishers_of(self, group: GroupRelay) -> list[Publisher]:
        """Return the publisher of a group's manifests, if it has one."""
        held = self._publishers.get(group.config.name)
        return [held[0]] if held else []

    def wait_until_acknowledged(self, deadline: int) -> None:
        """Publish what was noted; give subscribers until `deadline`, by time.monotonic_ns(), to get it."""
        self.queue.publish()
        for publisher, _ in self._publishers.values():
            publisher.wait_until_acknowledged(max(0, deadline - self._runtime.monotonic_ns()))

    def _is_wanted(self, group: GroupRelay) -> bool:
        return group.config.options.manifest and self._entities.purpose is Purpose.RELAY

    def _outlet(self, name: str) -> Outlet:
        if name not in self._publishers:
            publisher = self._entities.publisher(DiagnosticArray, manifest_topic(name), _PROFILE)
            self._publishers[name] = publisher, self._backend.outlet(publisher)
        return self._publishers[name][1]

    def _connect(self, group: GroupRelay, outlet: Outlet) -> None:
        resolve = self._node.resolve_topic
        topics = [(resolve(each.topic), resolve(each.output)) for each in group.config.topics]
        bundle = None if group.config.bundle is None else resolve(group.config.bundle.topic)
        writer = ManifestWriter(group.config, node=self._node.name, topics=topics, bundle=bundle)
        begun = self._begun[group] = self.queue.begin(group.config.name, writer, outlet)
        self._loop.call(lambda: group.tell_sets(begun))
