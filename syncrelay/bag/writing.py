"""Sets of a replay as a recording: what the relay would have published."""

from collections.abc import Callable
from typing import TypeAlias

from syncrelay.bag.bindings import GroupBinding, Input
from syncrelay.bag.definitions import as_ros2, begins_with_header, converter
from syncrelay.bag.mcap_output import McapOutput, Output
from syncrelay.bag.qos import output_profile
from syncrelay.bag.recording import Channel, Encoding
from syncrelay.cdr import patch_stamp
from syncrelay.errors import BagError
from syncrelay.sync import Match, Message, Outcome

_Payload: TypeAlias = Callable[[bytes, int | None], bytes]
"""From a recorded payload and a set's common stamp to what leaves."""


class SetWriter:
    """Writes the sets of a replay as the relay would publish them, at the time at which they leave.

    Payloads are those that were recorded, with the stamp of `restamp` in their place if the file has one. Those of a
    ROS 1 bag are written as ROS 2 has them: CDR, without the header's seq.
    """

    def __init__(self, recording: McapOutput) -> None:
        self._recording = recording
        self._outputs: dict[str, Output] = {}
        self._payloads: dict[tuple[str, Channel], _Payload] = {}

    def begin(self, binding: GroupBinding) -> None:
        """Make the outputs of a group, so that those without a message are there too."""
        for each in binding.inputs:
            if each.channels:
                self._add(each)

    def take(self, binding: GroupBinding, outcome: Outcome, now: int) -> None:
        """Write a set that leaves at `now`; drops are none."""
        if not isinstance(outcome, Match):
            return
        for each, message in zip(binding.inputs, outcome.messages, strict=True):
            if message is not None:
                self._write(each, message, outcome.stamp, now)

    def _write(self, each: Input, message: Message, stamp: int | None, now: int) -> None:
        channel, _, payload = message.payload
        written = self._payloads[each.output, channel](payload, stamp)
        self._recording.write(self._outputs[each.output], written, now)

    def _add(self, each: Input) -> None:
        first = each.channels[0]
        offered = [profile for channel in each.channels for profile in channel.qos]
        profile = output_profile(each.config.qos, offered)
        self._outputs[each.output] = self._recording.add(each.output, first.type, *as_ros2(first), profile)
        for channel in each.channels:
            self._payloads[each.output, channel] = _payload(each, channel)


def _payload(each: Input, channel: Channel) -> _Payload:
    convert = converter(channel) if channel.encoding is Encoding.ROS1 else None
    has_header = begins_with_header(channel)
    # Of a type that nothing is known of, the file says where the stamp is.
    restamped = each.config.stamp == "header" if has_header is None else has_header

    def payload_of(recorded: bytes, stamp: int | None) -> bytes:
        payload = recorded if convert is None else convert(recorded)
        if payload is None:
            raise BagError(f"{channel.topic}: a message does not fit the definition of {channel.type} in the bag")
        return payload if stamp is None or not restamped else patch_stamp(payload, stamp)

    return payload_of
