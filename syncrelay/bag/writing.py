"""Sets of a replay as a recording: MCAP as rosbag2 writes it, alone or in a rosbag2 folder with its metadata."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self, TypeAlias

import yaml
from mcap.writer import Writer

from syncrelay.bag.definitions import as_ros2, begins_with_header, converter
from syncrelay.bag.qos import Profile, output_profile, write_profile
from syncrelay.bag.recording import Channel, Encoding
from syncrelay.bag.wiring import Input, Wiring
from syncrelay.cdr import patch_stamp
from syncrelay.errors import BagError
from syncrelay.sync import Match, Message, Outcome

MCAP_SUFFIX: Final = ".mcap"
_PROFILE: Final = "ros2"
# The version of rosbag2's metadata that Jazzy writes.
_METADATA_VERSION: Final = 9

_Payload: TypeAlias = Callable[[bytes, int | None], bytes]
"""From a recorded payload and a set's common stamp to what leaves."""


@dataclass(slots=True)
class _Output:
    """One output: its channel in the file, and what is written about it in the end."""

    channel: int
    topic: str
    type: str
    type_hash: str
    profile: Profile
    count: int = 0


class RecordingWriter:
    """Writes the sets of a replay as the relay would publish them; a context manager that ends the file in order.

    Payloads are those that were recorded, with the stamp of `restamp` in their place if the file has one. Those of a
    ROS 1 bag are written as ROS 2 has them: CDR, without the header's seq.
    """

    def __init__(self, path: Path) -> None:
        """Begin a file, if the name ends in .mcap, or a folder; raises BagError where it exists or can't be made."""
        self._folder = None if path.suffix == MCAP_SUFFIX else path
        self._path = path if self._folder is None else path / f"{path.name}_0{MCAP_SUFFIX}"
        if path.exists():
            raise BagError(f"{path}: exists already, and is not overwritten")
        try:
            if self._folder is not None:
                self._folder.mkdir(parents=True)
            self._file = self._path.open("xb")
        except OSError as error:
            raise BagError(f"{self._path}: cannot be written: {error.strerror}") from error
        self._writer = Writer(self._file)
        self._writer.start(_PROFILE)
        self._outputs: dict[str, _Output] = {}
        self._payloads: dict[tuple[str, Channel], _Payload] = {}
        self._schemas: dict[str, int] = {}
        self._begin: int | None = None
        self._end = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._writer.finish()  # type: ignore[no-untyped-call]  # mcap's
        self._file.close()
        if self._folder is not None:
            text = yaml.safe_dump(self._metadata(), sort_keys=False)
            (self._folder / "metadata.yaml").write_text(text, encoding="utf-8")

    def begin(self, wiring: Wiring) -> None:
        """Make the outputs of a group, so that those without a message are there too."""
        for each in wiring.inputs:
            if each.channels:
                self._output(each)

    def take(self, wiring: Wiring, outcome: Outcome, now: int) -> None:
        """Write a set that leaves at `now`; drops are none."""
        if not isinstance(outcome, Match):
            return
        for each, message in zip(wiring.inputs, outcome.messages, strict=True):
            if message is not None:
                self._write(each, message, outcome.stamp, now)

    def _write(self, each: Input, message: Message, stamp: int | None, now: int) -> None:
        channel, _, payload = message.payload
        output = self._outputs[each.output]
        written = self._payloads[each.output, channel](payload, stamp)
        self._writer.add_message(output.channel, now, written, now, output.count)
        output.count += 1
        self._begin = now if self._begin is None else self._begin
        self._end = max(self._end, now)

    def _output(self, each: Input) -> None:
        first = each.channels[0]
        definition, type_hash = as_ros2(first)
        if first.type not in self._schemas:
            text = definition.text.encode() if definition else b""
            encoding = definition.format if definition else ""
            self._schemas[first.type] = self._writer.register_schema(first.type, encoding, text)
        profile = output_profile(each.config.qos, [offered for channel in each.channels for offered in channel.qos])
        about = {"offered_qos_profiles": _as_text([write_profile(profile)]), "topic_type_hash": type_hash}
        number = self._writer.register_channel(each.output, Encoding.CDR.value, self._schemas[first.type], about)
        self._outputs[each.output] = _Output(number, each.output, first.type, type_hash, profile)
        for channel in each.channels:
            self._payloads[each.output, channel] = _payload(each, channel)

    def _metadata(self) -> dict[str, Any]:
        begin = self._begin or 0
        count = sum(output.count for output in self._outputs.values())
        span = {
            "starting_time": {"nanoseconds_since_epoch": begin},
            "duration": {"nanoseconds": self._end - begin if count else 0},
            "message_count": count,
        }
        about = {
            "version": _METADATA_VERSION,
            "storage_identifier": "mcap",
            **span,
            "topics_with_message_count": [_topic_metadata(output) for output in self._outputs.values()],
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [self._path.name],
            "files": [{"path": self._path.name, **span}],
            "custom_data": None,
            "ros_distro": "jazzy",
        }
        return {"rosbag2_bagfile_information": about}


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


def _topic_metadata(output: _Output) -> dict[str, Any]:
    about = {
        "name": output.topic,
        "type": output.type,
        "serialization_format": Encoding.CDR.value,
        "offered_qos_profiles": [write_profile(output.profile)],
        "type_description_hash": output.type_hash,
    }
    return {"topic_metadata": about, "message_count": output.count}


def _as_text(value: Any) -> str:
    return yaml.safe_dump(value, sort_keys=False).strip()
