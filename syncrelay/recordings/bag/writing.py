"""Writes the sets of a replay as a recording of what the relay would have published."""

from collections.abc import Callable
from typing import NamedTuple

from syncrelay.cdr import patch_stamp
from syncrelay.config.names_in_graph import MANIFEST_TYPE, manifest_topic
from syncrelay.config.profile import Profile, matched
from syncrelay.dataflow.manifest import MANIFEST_DEPTH, ManifestWriter, Note, header_stamp
from syncrelay.errors import BagError
from syncrelay.recordings.bag.bindings import GroupBinding, Input
from syncrelay.recordings.bag.definitions import as_ros2, begins_with_header, converter, jazzy_definition
from syncrelay.recordings.bag.mcap_output import McapOutput, Output
from syncrelay.recordings.bag.recording import Channel, Encoding
from syncrelay.sync import Match, Message, Outcome


class Outgoing(NamedTuple):
    """How a recorded payload and the common stamp of a set become an output, and whether it has a header for that."""

    written: Callable[[bytes, int | None], bytes]
    has_header: bool


class _Manifest(NamedTuple):
    """The writer of a group's manifests, and their topic in the recording."""

    writer: ManifestWriter
    output: Output


class SetWriter:
    """Writes the sets of a replay as the relay would publish them, with the time at which they leave.

    Payloads are the recorded bytes, restamped if the file says so. ROS 1 payloads become CDR without the header's seq.
    A manifest follows the messages of its set.
    """

    def __init__(self, recording: McapOutput) -> None:
        self._recording = recording
        self._outputs: dict[str, Output] = {}
        self._payloads: dict[tuple[str, Channel], Outgoing] = {}
        self._manifests: dict[str, _Manifest] = {}
        self.messages = 0
        """How many messages were written, without manifests."""

    def begin(self, binding: GroupBinding) -> None:
        """Add the output topics of a group; those without a message are recorded too."""
        for each in binding.inputs:
            if each.channels:
                self._add(each)
        if binding.group.options.manifest:
            self._manifests[binding.group.name] = self._manifest(binding)

    def take(self, binding: GroupBinding, outcome: Outcome, now: int) -> None:
        """Write a set that leaves at `now`; drops are ignored."""
        if not isinstance(outcome, Match):
            return
        pairs = zip(binding.inputs, outcome.messages, strict=True)
        stamp = outcome.stamp
        written = [
            (None, None, 0) if message is None else self._write(each, message, stamp, now) for each, message in pairs
        ]
        manifest = self._manifests.get(binding.group.name)
        if manifest is not None:
            left_as, received, sent = zip(*written, strict=True)
            latency = now - max(each for each in received if each is not None)
            note = Note(manifest.output.count + 1, latency, stamp, outcome.stamps, left_as, received, sent, {})
            self._recording.write(manifest.output, manifest.writer.write(note), now)

    def _write(self, each: Input, message: Message, stamp: int | None, now: int) -> tuple[int, int, int]:
        """Write a message; return its stamp as it leaves, when it was received, and its number among its topic's."""
        channel, received, payload = message.payload
        output, payload_of = self._outputs[each.output], self._payloads[each.output, channel]
        content = payload_of.written(payload, stamp)
        self._recording.write(output, content, now)
        self.messages += 1
        is_as_matched = not payload_of.has_header or (stamp is None and each.config.is_by_header)
        leaves_as = message.stamp if is_as_matched else header_stamp(content)
        return leaves_as, received, output.count

    def _manifest(self, binding: GroupBinding) -> "_Manifest":
        node = binding.group.inputs.node
        topics = [(each.topic, each.output) for each in binding.inputs]
        writer = ManifestWriter(binding.group, node=node.absolute("~"), topics=topics)
        topic, profile = node.absolute(manifest_topic(binding.group.name)), Profile(depth=MANIFEST_DEPTH)
        return _Manifest(writer, self._recording.add(topic, MANIFEST_TYPE, *jazzy_definition(MANIFEST_TYPE), profile))

    def _add(self, each: Input) -> None:
        first = each.channels[0]
        offered = [profile for channel in each.channels for profile in channel.qos]
        profile = matched(each.config.qos, offered)
        self._outputs[each.output] = self._recording.add(each.output, first.type, *as_ros2(first), profile)
        for channel in each.channels:
            self._payloads[each.output, channel] = outgoing(each, channel)


def outgoing(each: Input, channel: Channel) -> Outgoing:
    """Return the function that turns a recorded message into its output.

    The function raises BagError for a message that does not fit its definition.
    """
    convert = converter(channel) if channel.encoding is Encoding.ROS1 else None
    is_known = begins_with_header(channel)
    # If the type is unknown, the file's `stamp` decides.
    has_header = each.config.stamp == "header" if is_known is None else is_known

    def payload_of(recorded: bytes, stamp: int | None) -> bytes:
        payload = recorded if convert is None else convert(recorded)
        if payload is None:
            raise BagError(f"{channel.topic}: a message does not fit the definition of {channel.type} in the bag")
        return payload if stamp is None or not has_header else patch_stamp(payload, stamp)

    return Outgoing(payload_of, has_header)
