"""Serialized messages in a file, one after another: what the player reads and the collector writes."""

import struct
from collections.abc import Iterable
from pathlib import Path
from typing import BinaryIO, NamedTuple

# Bytes of topic and of type name, receive time in nanoseconds, bytes of payload.
_HEAD = struct.Struct("<HHqI")


class Frame(NamedTuple):
    """A message as it travels: `time` is when it was received, in nanoseconds, `payload` its CDR bytes."""

    topic: str
    type_name: str
    time: int
    payload: bytes


def append(file: BinaryIO, frame: Frame) -> None:
    topic, type_name = frame.topic.encode(), frame.type_name.encode()
    head = _HEAD.pack(len(topic), len(type_name), frame.time, len(frame.payload))
    file.write(head + topic + type_name + frame.payload)


def write(path: Path, frames: Iterable[Frame]) -> None:
    with path.open("wb") as file:
        for frame in frames:
            append(file, frame)


def read(path: Path) -> list[Frame]:
    return parse(path.read_bytes())[0]


def parse(content: bytes) -> tuple[list[Frame], int]:
    """All whole frames and the bytes they take: the last frame may still be being written."""
    found: list[Frame] = []
    begin = 0
    while len(content) - begin >= _HEAD.size:
        topic_size, type_size, time, payload_size = _HEAD.unpack_from(content, begin)
        topic_at = begin + _HEAD.size
        type_at = topic_at + topic_size
        payload_at = type_at + type_size
        end = payload_at + payload_size
        if end > len(content):
            break
        topic, type_name = content[topic_at:type_at].decode(), content[type_at:payload_at].decode()
        found.append(Frame(topic, type_name, time, content[payload_at:end]))
        begin = end
    return found, begin
