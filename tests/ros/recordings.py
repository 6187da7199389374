"""The shared recordings as frames, in the order in which they were received."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from rosbags.highlevel import AnyReader

from tests.ros.cdr_messages import COMPRESSED_IMAGE, IMAGE, NS_PER_SECOND, STORE, header, serialize
from tests.ros.frames import Frame

VEHICLE = "vehicle_mtig_sick_tilt_laser/tilt_laser.bag"
HUSKY = "husky_jackal_robot_localization/test1.bag"
_TUM = "tum_rgbd/fr1_rpy"
RGB, DEPTH = "/camera/rgb", "/camera/depth"


def bag(path: Path, topics: Sequence[str]) -> list[Frame]:
    """Some topics of a ROS 1 bag as ROS 2 would carry them: CDR in place of ROS 1's bytes, no header.seq."""
    with AnyReader([path]) as reader:
        chosen = [connection for connection in reader.connections if connection.topic in topics]
        return [
            Frame(one.topic, one.msgtype, received, bytes(STORE.ros1_to_cdr(raw, one.msgtype)))
            for one, received, raw in reader.messages(chosen)
        ]


def tum_stamps(data: Path) -> list[Frame]:
    """fr1_rpy's lists of colour and depth images, as small Images with their stamps."""
    rows = [(stamp, RGB) for stamp, _ in _listed(data, "rgb")]
    rows += [(stamp, DEPTH) for stamp, _ in _listed(data, "depth")]
    return [Frame(topic, IMAGE, stamp, _small_image(stamp)) for stamp, topic in sorted(rows)]


def tum_pictures(data: Path) -> list[Frame]:
    """The 40 colour and 40 depth PNG files of fr1_rpy, whole, as CompressedImages."""
    rows = [
        (stamp, topic, path)
        for topic, name in ((RGB, "rgb"), (DEPTH, "depth"))
        for stamp, path in _listed(data, name)
        if path.exists()
    ]
    return [Frame(topic, COMPRESSED_IMAGE, stamp, _picture(stamp, path)) for stamp, topic, path in sorted(rows)]


def _listed(data: Path, name: str) -> Iterator[tuple[int, Path]]:
    for line in (data / _TUM / f"{name}.txt").read_text().splitlines():
        if not line.startswith("#"):
            seconds, path = line.split()
            whole, _, fraction = seconds.partition(".")
            yield int(whole) * NS_PER_SECOND + int(fraction.ljust(9, "0")), data / _TUM / path


def _small_image(stamp: int) -> bytes:
    pixels = np.frombuffer(stamp.to_bytes(8, "little"), dtype=np.uint8)
    return serialize(IMAGE, header(stamp, "kinect"), 1, 8, "mono8", 0, 8, pixels)


def _picture(stamp: int, path: Path) -> bytes:
    content = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    return serialize(COMPRESSED_IMAGE, header(stamp, "kinect"), "png", content)
