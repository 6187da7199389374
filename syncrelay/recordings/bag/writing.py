"""Writes the sets of a replay as a recording of what the relay would have published."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from syncrelay.cdr import patch_stamp
from syncrelay.cdr_assembly import UnfitError
from syncrelay.config.names_in_graph import MANIFEST_TYPE, manifest_topic
from syncrelay.config.profile import Profile, matched
from syncrelay.config.resolved import BundleConfig
from syncrelay.dataflow.bundle import Bundle
from syncrelay.dataflow.manifest import MANIFEST_DEPTH, ManifestWriter, Note, header_stamp
from syncrelay.errors import BagError
from syncrelay.recordings.bag.bindings import GroupBinding, Input
from syncrelay.recordings.bag.bundles import recorded_bundle
from syncrelay.recordings.bag.definitions import as_ros2, begins_with_header, converter, jazzy_definition
from syncrelay.recordings.bag.mcap_output import McapOutput, Output
from syncrelay.recordings.bag.recording import Channel, Encoding
from syncrelay.sync import Match, Outcome


class Outgoing(NamedTuple):
    """How a recorded payload and the common stamp of a set become an output, and whether it has a header for that."""

    written: Callable[[bytes, int | None], bytes]
    has_header: bool


class _Bundles(NamedTuple):
    """What makes the bundles of a group, and their topic in the recording."""

    bundle: Bundle
    output: Output


class _Manifest(NamedTuple):
    """The writer of a group's manifests, and their topic in the recording."""

    writer: ManifestWriter
    output: Output


@dataclass(slots=True)
class _Leaving:
    """How the sets of a group leave: for each input, by the channel, what its payloads become, and its topic if any."""

    payloads: list[dict[Channel, Outgoing]]
    outputs: list[Output | None]
    bundles: _Bundles | None = None
    manifest: _Manifest | None = None


class SetWriter:
    """Writes the sets of a replay as the relay would publish them, with the time at which they leave.

    Payloads are the recorded bytes, restamped if the file says so. ROS 1 payloads become CDR without the header's seq.
    A manifest follows the messages of its set.
    """

    def __init__(self, recording: McapOutput) -> None:
        self._recording = recording
        self._leaving: dict[str, _Leaving] = {}
        self.left_out: list[str] = []
        """A sentence for each group whose bundles are not written, because their type is not installed here."""
        self.messages = 0
        """How many messages were written, without manifests."""

    def begin(self, binding: GroupBinding) -> None:
        """Add the output topics of a group; those without a message are recorded too.

        Raises BagError where the type of its bundles is installed and cannot hold what was recorded.
        """
        has_outputs = binding.group.options.outputs
        leaving = _Leaving(
            [{channel: outgoing(each, channel) for channel in each.channels} for each in binding.inputs],
            [self._output(each) if each.channels and has_outputs else None for each in binding.inputs],
        )
        if binding.group.bundle is not None and binding.is_complete:
            leaving.bundles = self._add_bundles(binding, binding.group.bundle)
        if binding.group.options.manifest:
            leaving.manifest = self._manifest(binding)
        self._leaving[binding.group.name] = leaving

    def take(self, binding: GroupBinding, outcome: Outcome, now: int) -> None:
        """Write a set that leaves at `now`; drops are ignored."""
        if not isinstance(outcome, Match):
            return
        leaving, common = self._leaving[binding.group.name], outcome.stamp
        contents: list[bytes | None] = []
        left_as: list[int | None] = []
        received: list[int | None] = []
        for index, message in enumerate(outcome.messages):
            if message is None:
                contents.append(None)
                left_as.append(None)
                received.append(None)
                continue
            channel, at, payload = message.payload
            written, has_header = leaving.payloads[index][channel]
            content = written(payload, common)
            is_as_matched = not has_header or (common is None and binding.inputs[index].config.is_by_header)
            contents.append(content)
            left_as.append(message.stamp if is_as_matched else header_stamp(content))
            received.append(at)
        sent = self._publish(binding, outcome, contents, now)
        if leaving.manifest is not None:
            writer, output = leaving.manifest
            latency = now - max([each for each in received if each is not None])
            bundle = 0 if leaving.bundles is None else leaving.bundles.output.count
            note = Note(output.count + 1, latency, common, outcome.stamps, left_as, received, sent, {}, bundle)
            self._recording.write(output, writer.write(note), now)

    def _publish(
        self, binding: GroupBinding, match: Match, contents: Sequence[bytes | None], now: int
    ) -> Sequence[int]:
        """Write the messages of a set; return the number of each among those of its topic, 0 of one that is missing."""
        leaving = self._leaving[binding.group.name]
        if (bundles := leaving.bundles) is not None:
            try:
                whole = bundles.bundle.content(contents, match.stamps, match.stamp, bundles.output.count + 1)
            except UnfitError as error:
                raise BagError(f"{bundles.output.topic}: {error}") from error
            self._write(bundles.output, whole, now)
            if not binding.group.options.outputs:
                return [0 if each is None else bundles.output.count for each in contents]
        sent = [0] * len(contents)
        for index, (content, output) in enumerate(zip(contents, leaving.outputs, strict=True)):
            if content is not None and output is not None:
                self._write(output, content, now)
                sent[index] = output.count
        return sent

    def _write(self, output: Output, content: bytes, now: int) -> None:
        self._recording.write(output, content, now)
        self.messages += 1

    def _manifest(self, binding: GroupBinding) -> "_Manifest":
        node = binding.group.inputs.node
        topics = [(each.topic, each.output) for each in binding.inputs]
        bundle = None if binding.group.bundle is None else node.absolute(binding.group.bundle.topic)
        writer = ManifestWriter(binding.group, node=node.absolute("~"), topics=topics, bundle=bundle)
        topic, profile = node.absolute(manifest_topic(binding.group.name)), Profile(depth=MANIFEST_DEPTH)
        return _Manifest(writer, self._recording.add(topic, MANIFEST_TYPE, *jazzy_definition(MANIFEST_TYPE), profile))

    def _output(self, each: Input) -> Output:
        first = each.channels[0]
        return self._recording.add(each.output, first.type, *as_ros2(first), _profile(each))

    def _add_bundles(self, binding: GroupBinding, config: BundleConfig) -> _Bundles | None:
        recorded = recorded_bundle(binding.group, [channel for each in binding.inputs for channel in each.channels])
        if recorded is None:
            why = f"{config.type} is not installed here, or not sourced"
            self.left_out.append(f"{binding.group.name}: its bundles are left out: {why}")
            return None
        profile = matched(config.qos, [_profile(each) for each in binding.inputs if each.channels])
        topic = binding.group.inputs.node.absolute(config.topic)
        output = self._recording.add(topic, config.type, recorded.definition, recorded.type_hash, profile)
        return _Bundles(recorded.bundle, output)


def _profile(each: Input) -> Profile:
    """Return what an input's messages leave with."""
    return matched(each.config.qos, [profile for channel in each.channels for profile in channel.qos])


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
