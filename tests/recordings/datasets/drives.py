"""Recordings of a robot with two cameras, joints and commands, whose values tell their stamps."""

import io
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from syncrelay.config import Config, load_text
from syncrelay.recordings.datasets.lerobot import join_episodes, write_episode
from tests.recordings.bag.making import write_mcap
from tests.ros.cdr_messages import STORE, STRING, header, serialize
from tests.ros.frames import Frame
from tests.ros.streams import MS

START = 1_700_000_000_000_000_000
HEIGHT, WIDTH = 48, 64
JOINTS = ("pan", "lift", "grip")
INPUTS = """
      - {topic: /camera, type: sensor_msgs/msg/Image}
      - {topic: /wrist, type: sensor_msgs/msg/CompressedImage}
      - {topic: /joints, type: sensor_msgs/msg/JointState}
      - {topic: /cmd, type: geometry_msgs/msg/TwistStamped}
"""
FEATURES = """
      observation.images.front: /camera
      observation.images.wrist: /wrist
      observation.state: [/joints:position, /cmd:twist.angular.z]
      action: /cmd:twist.linear
"""


def config(*, fps: int = 10, more: str = "", inputs: str = INPUTS, features: str = FEATURES, group: str = "") -> Config:
    return load_text(f"""
version: 1
groups:
  robot:
    policy: {group or "exact_time"}
    topics:{inputs}
export:
  lerobot:
    fps: {fps}
    {more or "task: pick up the cube"}
    features:{features}
""")


def picture(stamp_ms: int, *, height: int = HEIGHT, width: int = WIDTH) -> np.ndarray[Any, Any]:
    """Slow shades of colour, which a video keeps, 4 or more brighter or darker 50 ms later."""
    across = np.linspace(0, 80, width)[None, :, None]
    down = np.linspace(0, 40, height)[:, None, None]
    return (across + down + np.array([20, 40, 60]) + 4 * (stamp_ms // 50 % 15)).astype(np.uint8)


def image(stamp_ms: int, *, encoding: str = "rgb8", pixels: np.ndarray[Any, Any] | None = None) -> bytes:
    """An Image; its rows have some bytes more than their pixels."""
    pixels = picture(stamp_ms) if pixels is None else pixels
    padded = np.zeros((pixels.shape[0], pixels.strides[0] + 5), np.uint8)
    padded[:, :-5] = np.frombuffer(pixels.tobytes(), np.uint8).reshape(pixels.shape[0], -1)
    size = (pixels.shape[0], pixels.shape[1])
    return serialize(
        "sensor_msgs/msg/Image", header(at(stamp_ms)), *size, encoding, 0, padded.shape[1], padded.reshape(-1)
    )


def compressed(stamp_ms: int, *, data: bytes | None = None) -> bytes:
    file = io.BytesIO()
    Image.fromarray(picture(stamp_ms + 350)).save(file, "PNG")
    content = np.frombuffer(file.getvalue() if data is None else data, np.uint8)
    return serialize("sensor_msgs/msg/CompressedImage", header(at(stamp_ms)), "png", content)


def joints(stamp_ms: int, *, names: Iterable[str] = JOINTS, values: Iterable[float] | None = None) -> bytes:
    values = [stamp_ms / 1000 + each for each in range(3)] if values is None else values
    empty = np.array([], np.float64)
    return serialize(
        "sensor_msgs/msg/JointState", header(at(stamp_ms)), list(names), np.array(values, np.float64), empty, empty
    )


def command(stamp_ms: int, *, x: float | None = None) -> bytes:
    vector = STORE.types["geometry_msgs/msg/Vector3"]
    twist = STORE.types["geometry_msgs/msg/Twist"](
        vector(stamp_ms / 100 if x is None else x, -1.0, 0.5), vector(0.0, 0.0, -stamp_ms / 7)
    )
    return serialize("geometry_msgs/msg/TwistStamped", header(at(stamp_ms)), twist)


def task(_stamp_ms: int, *, words: str = "open the door") -> bytes:
    return serialize(STRING, words)


TYPES: dict[str, tuple[str, Callable[[int], bytes]]] = {
    "/camera": ("sensor_msgs/msg/Image", image),
    "/wrist": ("sensor_msgs/msg/CompressedImage", compressed),
    "/joints": ("sensor_msgs/msg/JointState", joints),
    "/cmd": ("geometry_msgs/msg/TwistStamped", command),
    "/task": (STRING, task),
}


def at(stamp_ms: int) -> int:
    return START + stamp_ms * MS


def drive(
    path: Path,
    stamps_ms: Iterable[int] = range(0, 2000, 100),
    *,
    instead: Mapping[tuple[str, int], bytes | None] | None = None,
    topics: Iterable[str] = ("/camera", "/wrist", "/joints", "/cmd"),
) -> Path:
    """A recording in which every topic has a message at each of these stamps; `instead` replaces or removes some."""
    instead = instead or {}
    frames = []
    for stamp in stamps_ms:
        for topic in topics:
            type_name, made = TYPES[topic]
            payload = instead[topic, stamp] if (topic, stamp) in instead else made(stamp)
            if payload is not None:
                frames.append(Frame(topic, type_name, at(stamp) + MS, payload))
    return write_mcap(path, frames)


def written(folder: Path, *bags: Path, loaded: Config | None = None) -> dict[str, Any]:
    """Write a dataset of recordings as FOLDER/dataset; return its facts, with those of its episodes by their names."""
    places = {bag.stem: folder / "episodes" / bag.stem for bag in bags}
    facts = {}
    for bag in bags:
        places[bag.stem].mkdir(parents=True)
        facts[bag.stem] = write_episode(bag.stem, [str(bag)], loaded or config(), places[bag.stem])
    (folder / "dataset").mkdir()
    return {**join_episodes(places, folder / "dataset"), "episodes": facts}
