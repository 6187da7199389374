"""Writes the sets of a replay as a recording of what the relay would have published."""

from collections.abc import Callable, Sequence
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
from syncrelay.sync import Match, Message, Outcome


class Outgoing(NamedTuple):
    """How a recorded payload and the common stamp of a set become an output, and whether it has a header for that."""

    written: Callable[[bytes, int | None], bytes]
    has_header: bool


class _Left(NamedTuple):
    """A message of a set as it leaves, its stamp then, and when it was received."""

    content: bytes
    stamp: int
    received: int


class _Bundles(NamedTuple):
    """What makes the bundles of a group, and their topic in the recording."""

    bundle: Bundle
    output: Output


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
        self._bundles: dict[str, _Bundles] = {}
        self.left_out: list[str] = []
        """A sentence for each group whose bundles are not written, because their type is not installed here."""
        self.messages = 0
        """How many messages were written, without manifests."""

    def begin(self, binding: GroupBinding) -> None:
        """Add the output topics of a group; those without a message are recorded too.

        Raises BagError where the type of its bundles is installed and cannot hold what was recorded.
        """
        for each in binding.inputs:
            for channel in each.channels:
                self._payloads[each.output, channel] = outgoing(each, channel)
            if each.channels and binding.group.options.outputs:
                self._outputs[each.output] = self._output(each)
        if binding.group.bundle is not None and binding.is_complete:
            self._add_bundles(binding, binding.group.bundle)
        if binding.group.options.manifest:
            self._manifests[binding.group.name] = self._manifest(binding)

    def take(self, binding: GroupBinding, outcome: Outcome, now: int) -> None:
        """Write a set that leaves at `now`; drops are ignored."""
        if not isinstance(outcome, Match):
            return
        pairs = zip(binding.inputs, outcome.messages, strict=True)
        left = [None if message is None else self._left(each, message, outcome.stamp) for each, message in pairs]
        sent = self._publish(binding, outcome, left, now)
        manifest = self._manifests.get(binding.group.name)
        if manifest is not None:
            stamps = [each and each.stamp for each in left]
            received = [each and each.received for each in left]
            latency = now - max(each for each in received if each is not None)
            number, bundles = manifest.output.count + 1, self._bundles.get(binding.group.name)
            note = Note(number, latency, outcome.stamp, outcome.stamps, stamps, received, sent, {})
            note = note._replace(bundle=0 if bundles is None else bundles.output.count)
            self._recording.write(manifest.output, manifest.writer.write(note), now)

    def _left(self, each: Input, message: Message, stamp: int | None) -> _Left:
        channel, received, payload = message.payload
        payload_of = self._payloads[each.output, channel]
        content = payload_of.written(payload, stamp)
        is_as_matched = not payload_of.has_header or (stamp is None and each.config.is_by_header)
        return _Left(content, message.stamp if is_as_matched else header_stamp(content), received)

    def _publish(self, binding: GroupBinding, match: Match, left: Sequence[_Left | None], now: int) -> list[int]:
        """Write the messages of a set; return the number of each among those of its topic, 0 of one that is missing."""
        outputs = [self._outputs.get(each.output) for each in binding.inputs]
        bundles = self._bundles.get(binding.group.name)
        if bundles is not None:
            contents = [each and each.content for each in left]
            try:
                whole = bundles.bundle.content(contents, match.stamps, match.stamp, bundles.output.count + 1)
            except UnfitError as error:
                raise BagError(f"{bundles.output.topic}: {error}") from error
            self._write(bundles.output, whole, now)
            if not binding.group.options.outputs:
                return [bundles.output.count if each is not None else 0 for each in left]
        sent = [0] * len(left)
        for index, (each, output) in enumerate(zip(left, outputs, strict=True)):
            if each is not None and output is not None:
                self._write(output, each.content, now)
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

    def _add_bundles(self, binding: GroupBinding, config: BundleConfig) -> None:
        recorded = recorded_bundle(binding.group, [channel for each in binding.inputs for channel in each.channels])
        if recorded is None:
            why = f"{config.type} is not installed here, or not sourced"
            self.left_out.append(f"{binding.group.name}: its bundles are left out: {why}")
            return
        profile = matched(config.qos, [_profile(each) for each in binding.inputs if each.channels])
        topic = binding.group.inputs.node.absolute(config.topic)
        output = self._recording.add(topic, config.type, recorded.definition, recorded.type_hash, profile)
        self._bundles[binding.group.name] = _Bundles(recorded.bundle, output)


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
