"""Recordings of every kind, made by the libraries that others write them with."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import yaml
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Rosbag2Writer
from rosbags.rosbag2.metadata import dump_qos_v9
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tests.ros.cdr_messages import NS_PER_SECOND, STORE, VECTOR
from tests.ros.configs import config, inputs
from tests.ros.frames import Frame
from tests.ros.streams import MS, at
from tests.ros.transforms import TF

ROS1_STORE = get_typestore(Stores.ROS1_NOETIC)
ROS1_STORE.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms\n", TF))
CUSTOM = "rig_msgs/msg/Blip"
CUSTOM_TEXT = "std_msgs/Header header\nbuiltin_interfaces/Time seen\nuint32 number\nstring label\n"
CUSTOM_STORE = get_typestore(Stores.ROS2_JAZZY)
CUSTOM_STORE.register(get_types_from_msg(CUSTOM_TEXT, CUSTOM))
HEADERLESS = "rig_msgs/msg/Note"
CUSTOM_STORE.register(get_types_from_msg("string text\n", HEADERLESS))

_FOREVER = QosTime(9223372036, 854775807)
BEST_EFFORT = Qos(
    QosHistory.KEEP_LAST,
    5,
    QosReliability.BEST_EFFORT,
    QosDurability.VOLATILE,
    _FOREVER,
    _FOREVER,
    QosLiveliness.AUTOMATIC,
    _FOREVER,
    avoid_ros_namespace_conventions=False,
)


def rig(count: int = 40) -> list[Frame]:
    """A camera and a lidar, 3 ms apart, received a little after their stamps."""
    frames = at("/camera", *(100 * n + 3 for n in range(count))) + at("/lidar", *(100 * n for n in range(count)))
    return sorted((frame._replace(time=frame.time + 5 * MS) for frame in frames), key=lambda frame: frame.time)


def rig_file(name: str = "front", **keys: Any) -> str:
    """A file that matches the rig's camera and lidar; keys that are None are left out."""
    topics = inputs({"/camera": VECTOR, "/lidar": VECTOR})
    group = {"policy": "approximate_time", "slop": "5ms", "topics": topics, **keys}
    return config({name: {key: value for key, value in group.items() if value is not None}})


def write_mcap(
    path: Path,
    frames: Iterable[Frame],
    *,
    store: Any = STORE,
    profile: str = "ros2",
    qos: Sequence[Qos] = (),
    **options: Any,
) -> Path:
    """An MCAP file with the frames in their order, and with what rosbag2 adds of `qos`; `options` are the writer's."""
    with path.open("wb") as file:
        writer = McapWriter(file, **{"compression": CompressionType.NONE, **options})
        writer.start(profile)
        channels = {}
        for number, frame in enumerate(frames):
            if frame.topic not in channels:
                text, _ = store.generate_msgdef(frame.type_name, ros_version=2)
                schema = writer.register_schema(frame.type_name, "ros2msg", text.encode())
                profiles = yaml.safe_dump(dump_qos_v9(list(qos)))
                about = {"offered_qos_profiles": profiles, "topic_type_hash": store.hash_rihs01(frame.type_name)}
                channels[frame.topic] = writer.register_channel(frame.topic, "cdr", schema, about if qos else {})
            writer.add_message(channels[frame.topic], frame.time, frame.payload, frame.time, number + 7)
        writer.finish()
    return path


def write_rosbag2(
    folder: Path,
    frames: Sequence[Frame],
    *,
    plugin: StoragePlugin = StoragePlugin.SQLITE3,
    mode: CompressionMode = CompressionMode.NONE,
    qos: Sequence[Qos] = (),
    store: Any = STORE,
) -> Path:
    """A rosbag2 folder with the frames in their order."""
    writer = Rosbag2Writer(folder, version=9, storage_plugin=plugin)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        channels = {}
        for frame in frames:
            if frame.topic not in channels:
                channels[frame.topic] = writer.add_connection(
                    frame.topic, frame.type_name, typestore=store, offered_qos_profiles=qos
                )
            writer.write(channels[frame.topic], frame.time, frame.payload)
    return folder


def write_ros1(path: Path, frames: Sequence[Frame], *, compression: Any = None, chunk: int = 2000) -> Path:
    """A ROS 1 bag of the same messages as ROS 1 serializes them, with a `seq` in their headers; /lidar is latched."""
    writer = Ros1Writer(path)
    writer.chunk_threshold = chunk
    if compression is not None:
        writer.set_compression(compression)
    with writer:
        channels = {}
        for number, frame in enumerate(frames):
            if frame.topic not in channels:
                latching = int(frame.topic == "/lidar")
                channels[frame.topic] = writer.add_connection(
                    frame.topic, frame.type_name, typestore=ROS1_STORE, callerid="/rig", latching=latching
                )
            writer.write(channels[frame.topic], frame.time, as_ros1(frame, number))
    return path


def as_ros1(frame: Frame, number: int) -> bytes:
    """The payload as ROS 1 has it; rosbags writes a `seq` of 0, which must not be what makes it work."""
    payload = bytes(STORE.cdr_to_ros1(frame.payload, frame.type_name))
    if frame.type_name == TF:
        return payload
    return (number + 7).to_bytes(4, "little") + payload[4:]


def blip(stamp: int, *, seen: int, number: int = 0, label: str = "") -> bytes:
    """A message of a type that no package here defines."""
    types = CUSTOM_STORE.types
    time = types["builtin_interfaces/msg/Time"]
    header = types["std_msgs/msg/Header"](time(*divmod(stamp, NS_PER_SECOND)), "rig")
    message = types[CUSTOM](header, time(*divmod(seen, NS_PER_SECOND)), number, label)
    return bytes(CUSTOM_STORE.serialize_cdr(message, CUSTOM))
