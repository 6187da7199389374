"""Writes the sets of a replay as a recording of what the relay would have published."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import count, repeat
from typing import Final, NamedTuple

from syncrelay.cdr import patch_stamp
from syncrelay.cdr_assembly import UnfitError
from syncrelay.config import GroupConfig
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
from syncrelay.recordings.bag.replay import Left
from syncrelay.sync import Match

# How many bytes of messages wait, without manifests: restamped ones are copies.
_MOST_WAITING: Final = 1_000_000


class Outgoing(NamedTuple):
    """How a recorded payload and the common stamp of a set become an output, and whether it has a header for that."""

    written: Callable[[bytes, int | None], bytes]
    has_header: bool


class _Bundles(NamedTuple):
    """What makes the bundles of a group, and their topic in the recording."""

    bundle: Bundle
    output: Output


class _Manifests(NamedTuple):
    """What writes the manifests of a group, and their topic in the recording."""

    writer: ManifestWriter
    output: Output


class _Member(NamedTuple):
    """How the messages of a channel leave in the sets of an input.

    `is_as_matched` says that they leave with the stamp by which they were matched.
    """

    written: Callable[[bytes, int | None], bytes]
    is_as_matched: bool


class _Source(NamedTuple):
    """An input of a group: how the messages of its channels leave, and which one of its output the next one is."""

    members: dict[Channel, _Member]
    sent: Iterator[int]


@dataclass(slots=True)
class _Leaving:
    """How the sets of a group leave."""

    sources: list[_Source]
    channels: list[int]
    """The output of each input; empty if sets leave as bundles alone."""
    bundles: _Bundles | None
    manifests: _Manifests | None
    numbers: Iterator[int] = field(default_factory=partial(count, 1))
    noted: list[tuple[int, Note]] = field(default_factory=list)
    """Manifests that are to be written, and their places among the messages that are."""


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
        # The messages that wait to be written, and the size of those of inputs and of bundles.
        self._channels: list[int] = []
        self._payloads: list[bytes] = []
        self._times: list[int] = []
        self._size = 0

    def begin(self, binding: GroupBinding) -> None:
        """Add the output topics of a group; those without a message are recorded too.

        Raises BagError where the type of its bundles is installed and cannot hold what was recorded.
        """
        group = binding.group
        channels = [self._output(each) if each.channels else 0 for each in binding.inputs if group.options.outputs]
        self._leaving[group.name] = _Leaving(
            [_Source(_members(group, each), count(1) if channels else repeat(0)) for each in binding.inputs],
            channels,
            self._add_bundles(binding, group.bundle) if group.bundle is not None and binding.is_complete else None,
            self._manifests(binding) if group.options.manifest else None,
        )

    def take(self, left: Sequence[Left]) -> None:
        """Write the sets of what left."""
        for binding, outcomes, now in left:
            for outcome in outcomes:
                if isinstance(outcome, Match):
                    self._add(self._leaving[binding.group.name], outcome, now)
        self._write()

    def _add(self, leaving: _Leaving, match: Match, now: int) -> None:
        common, number, bundle = match.stamp, next(leaving.numbers), 0
        contents: list[bytes] = []
        values: list[int] = []
        missing: list[int] = []
        for index, (message, (members, sent)) in enumerate(zip(match.messages, leaving.sources, strict=True)):
            if message is None:
                missing.append(index)
                continue
            channel, received, payload = message.payload
            written, is_as_matched = members[channel]
            content, stamp = written(payload, common), message.stamp
            contents.append(content)
            values += stamp if is_as_matched else header_stamp(content), stamp, received, next(sent)
        channels, payloads = self._channels, self._payloads
        if leaving.bundles is not None:
            bundle = number
            channels.append(leaving.bundles.output.channel)
            payloads.append(_bundled(leaving.bundles, match, contents, number))
        if leaving.channels:
            payloads += contents
            self._size += sum(map(len, contents))
            channels += [each for index, each in enumerate(leaving.channels) if index not in missing]
        elif bundle:
            self._size += len(payloads[-1])
            values[3::4] = [number] * (len(values) // 4)
        if leaving.manifests is not None:
            note = Note(number, now - max(values[2::4]), common, values, tuple(missing), {}, bundle)
            leaving.noted.append((len(payloads), note))
            channels.append(leaving.manifests.output.channel)
            payloads.append(b"")
        self._times += [now] * (len(payloads) - len(self._times))
        if self._size >= _MOST_WAITING:
            self._write()

    def _write(self) -> None:
        """Write what waits. Manifests are made at once: one by one they take twice as long."""
        for leaving in self._leaving.values():
            if leaving.manifests is not None:
                contents = leaving.manifests.writer.write([note for _, note in leaving.noted])
                for (place, _), content in zip(leaving.noted, contents, strict=True):
                    self._payloads[place] = content
                self.messages -= len(contents)
                leaving.noted.clear()
        self._recording.write_all(self._channels, self._payloads, self._times)
        self.messages += len(self._payloads)
        self._channels, self._payloads, self._times, self._size = [], [], [], 0

    def _manifests(self, binding: GroupBinding) -> _Manifests:
        node = binding.group.inputs.node
        topics = [(each.topic, each.output) for each in binding.inputs]
        bundle = None if binding.group.bundle is None else node.absolute(binding.group.bundle.topic)
        writer = ManifestWriter(binding.group, node=node.absolute("~"), topics=topics, bundle=bundle)
        topic, profile = node.absolute(manifest_topic(binding.group.name)), Profile(depth=MANIFEST_DEPTH)
        return _Manifests(writer, self._recording.add(topic, MANIFEST_TYPE, *jazzy_definition(MANIFEST_TYPE), profile))

    def _output(self, each: Input) -> int:
        first = each.channels[0]
        return self._recording.add(each.output, first.type, *as_ros2(first), _profile(each)).channel

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


def _bundled(bundles: _Bundles, match: Match, contents: Sequence[bytes], number: int) -> bytes:
    there = iter(contents)
    each = [None if message is None else next(there) for message in match.messages]
    try:
        return bundles.bundle.content(each, match.stamps, match.stamp, number)
    except UnfitError as error:
        raise BagError(f"{bundles.output.topic}: {error}") from error


def _members(group: GroupConfig, each: Input) -> dict[Channel, _Member]:
    ways = {channel: outgoing(each, channel) for channel in each.channels}
    keeps_stamps = group.restamp is None and each.config.is_by_header
    return {channel: _Member(way.written, keeps_stamps or not way.has_header) for channel, way in ways.items()}


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
