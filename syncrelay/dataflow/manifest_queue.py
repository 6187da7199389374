"""Manifests on their way out: noted on the receive thread, written and published on another, up to 50 ms later.

Code that runs once in some milliseconds costs by its length, as nothing of it is in the processor's caches: a batch
of manifests costs far less than the same manifests one by one.
"""

import logging
from collections import deque
from collections.abc import Collection
from typing import Final

from syncrelay.config.wording import counted
from syncrelay.dataflow.backend import Outlet, PublishError
from syncrelay.dataflow.bugs import Bugs
from syncrelay.dataflow.flow import Flow
from syncrelay.dataflow.manifest import ManifestWriter, Note, header_stamp
from syncrelay.runtime import SYSTEM, Runtime
from syncrelay.sync import Match

_LOG = logging.getLogger("syncrelay")

# How long a manifest may wait for others. Measured: to wake, and to publish the first, costs as much as twenty more.
_BATCH_S: Final = 0.05
MOST_NOTED: Final = 10_000
"""How many manifests of all groups may wait to be published: those of ten seconds at 1000 sets a second."""


def _noted(flow: Flow, match: Match, latency: int, writer: ManifestWriter) -> Note:
    """Note what the manifest of the set that was just sent tells. Its payloads are not kept: they may be large."""
    messages, common = match.messages, match.stamp
    unpublished = {index: each.why for index, each in flow.unpublished.items()}
    bundle = 0 if flow.bundle is None or len(messages) in unpublished else flow.bundle.sent
    if writer.has_bundles_alone:
        sent = [bundle] * len(messages)
        unpublished = dict.fromkeys(range(len(messages)), *unpublished.values()) if unpublished else {}
    else:
        sent = [0 if outlet is None else outlet.sent for outlet in flow.outlets]
    values: list[int] = []
    missing: list[int] = []
    rows = zip(messages, flow.restamped, writer.is_by_header, sent, strict=True)
    for index, (message, has_header, is_matched, count) in enumerate(rows):
        if message is None:
            missing.append(index)
            continue
        stamp = left_as = message.stamp
        if has_header and common is not None:
            left_as = common
        elif has_header and not is_matched:
            # What was matched by another time leaves with the header that it came with.
            left_as = header_stamp(message.payload.content())
        values += left_as, stamp, message.payload.received, 0 if index in unpublished else count
    return Note(flow.n_sets, latency, common, values, tuple(missing), unpublished, bundle)


class GroupManifests:
    """The manifests of one group. Made and called by the queue, but for what the group calls on the receive thread."""

    def __init__(self, queue: "ManifestQueue", name: str, writer: ManifestWriter, outlet: Outlet) -> None:
        self.name = name
        self.is_heard = outlet.is_heard()
        """Whether anyone subscribed when this was last looked at. Any thread."""
        self.publish_noted = queue.publish
        """Publishes at once what was noted, of all groups. Any thread."""
        self._writer = writer
        self._outlet = outlet
        self._noted = queue.noted
        self._left_out = 0
        self._says_left_out = self._failed = False

    def tell(self, flow: Flow, match: Match, latency: int) -> None:
        """Have a manifest published of the set that a flow just sent, if anyone subscribes. On the receive thread."""
        if self.is_heard and len(self._noted) < MOST_NOTED:
            self._noted.append((self, _noted(flow, match, latency, self._writer)))
        elif self.is_heard:
            self._left_out += 1

    def publish(self, note: Note) -> None:
        """Publish a manifest; say it once where DDS refuses."""
        (content,) = self._writer.write([note])
        try:
            self._outlet.send_content(content)
        except PublishError as error:
            if not self._failed:
                _LOG.error("%s: a manifest could not be published: %s", self.name, error)
            self._failed = True
        else:
            self._failed = False

    def look(self) -> None:
        """See whether anyone subscribes, and say it once where manifests are left out."""
        self.is_heard = self._outlet.is_heard()
        if self._left_out and not self._says_left_out:
            self._says_left_out = True
            _LOG.error(
                "%s: leaving out manifests, because %d are waiting to be published; sets leave as usual",
                self.name,
                MOST_NOTED,
                extra={"group": self.name},
            )

    def end(self) -> None:
        """Take no more, and say how many were left out."""
        self.look()
        self.is_heard = False
        if self._left_out:
            _LOG.error(
                "%s: %s left out",
                self.name,
                f"{counted(self._left_out, 'manifest')} {'was' if self._left_out == 1 else 'were'}",
                extra={"group": self.name},
            )


class ManifestQueue:
    """Publishes the manifests of all groups in the order of their sets, in batches, on the thread that calls `run`.

    Each is published once, however many threads ask for it. All is called on the main thread, unless it says otherwise.
    An outlet may end when its group has ended and `keep` has returned: by then nothing is left to publish on it.
    """

    def __init__(self, *, bugs: Bugs, runtime: Runtime = SYSTEM) -> None:
        self.noted: deque[tuple[GroupManifests, Note]] = deque()
        """What is to be published, the oldest first."""
        self._bugs = bugs
        self._groups: tuple[GroupManifests, ...] = ()
        self._is_heard = False
        # Held while one is published; the receive thread takes it only where a group gets another output.
        self._lock = runtime.lock()
        self._wake = runtime.rest()
        self._stopping = False

    def begin(self, name: str, writer: ManifestWriter, outlet: Outlet) -> GroupManifests:
        """Publish the manifests of one more group."""
        begun = GroupManifests(self, name, writer, outlet)
        self._groups += (begun,)
        self._rest_as_heard()
        return begun

    def keep(self, groups: Collection[GroupManifests]) -> None:
        """Publish what was noted, and end all but these groups, which give no more sets."""
        self.publish()
        for each in self._groups:
            if each not in groups:
                each.end()
        self._groups = tuple(each for each in self._groups if each in groups)
        self._rest_as_heard()

    def look(self) -> None:
        """See which groups' manifests have subscribers."""
        for each in self._groups:
            each.look()
        self._rest_as_heard()

    def _rest_as_heard(self) -> None:
        was_heard, self._is_heard = self._is_heard, any(each.is_heard for each in self._groups)
        if self._is_heard and not was_heard:
            self._wake.set()

    def publish(self) -> None:
        """Publish what was noted. Any thread."""
        with self._lock:
            for _ in range(len(self.noted)):
                group, note = self.noted.popleft()
                try:
                    group.publish(note)
                except Exception as error:  # noqa: BLE001  it costs one manifest
                    self._bugs.log(f"publishing a manifest of {group.name}", error)

    def run(self) -> None:
        """Publish until `stop` is called, and what was noted by then."""
        while not self._stopping:
            self.publish()
            self._wake.wait(_BATCH_S if self._is_heard else None)
        self.publish()

    def stop(self) -> None:
        """Have `run` return. Any thread."""
        self._stopping = True
        self._wake.set()
