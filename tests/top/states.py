"""The states that the screens are tested with."""

import json
from collections.abc import Mapping
from functools import cache

from syncrelay.status import RelayState
from tests.top.rigs import Sensor, simulated

IMAGE, CLOUD, IMU = "sensor_msgs/msg/Image", "sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/Imu"


def group(topics: Mapping[str, str | None], **keys) -> dict:
    """A group of topics with their types; None for a type that comes from the graph."""
    listed = [{"topic": topic, **({"type": type_name} if type_name else {})} for topic, type_name in topics.items()]
    return {"policy": "approximate_time", "slop": "20ms", "queue_size": 10, **keys, "topics": listed}


def file(**groups) -> str:
    return json.dumps({"version": 1, "groups": groups})


FRONT = group({"/camera/image_raw": IMAGE, "/lidar/points": CLOUD}, slop="20ms")
CAMERA = Sensor(30, lag_ms=25, jitter_ms=1.5, publishers=("/camera_driver",))
LIDAR = Sensor(10, lag_ms=48, jitter_ms=2, shift_ms=6, publishers=("/lidar_driver",))
IMU_200 = Sensor(200, lag_ms=1, jitter_ms=0.2, publishers=("/imu_driver",))


@cache
def healthy() -> RelayState:
    sensors = {"/camera/image_raw": CAMERA, "/lidar/points": LIDAR}
    return simulated(file(front=FRONT), sensors)


@cache
def rig() -> RelayState:
    """Four groups: a healthy one, one whose camera has another clock, one with a short queue, one without a radar."""
    groups = {
        "front": group({"/camera/image_raw": IMAGE, "/lidar/points": CLOUD}),
        "rear": group({"/rear/image_raw": IMAGE, "/lidar/points": CLOUD}),
        "inertial": group({"/lidar/points": CLOUD, "/imu/data": IMU}, queue_size=5),
        "radar": group({"/lidar/points": CLOUD, "/radar/points": CLOUD}),
    }
    sensors = {
        "/camera/image_raw": CAMERA,
        "/lidar/points": LIDAR,
        "/rear/image_raw": Sensor(30, behind_ms=37_200, publishers=("/rear_camera",)),
        "/imu/data": IMU_200,
    }
    return simulated(file(**groups), sensors)


@cache
def silent() -> RelayState:
    sensors = {"/camera/image_raw": CAMERA, "/lidar/points": Sensor(10, until_s=12, publishers=("/lidar_driver",))}
    return simulated(file(front=FRONT), sensors)


@cache
def nothing() -> RelayState:
    """No message at all: nobody publishes."""
    return simulated(file(front=FRONT), {})


@cache
def without_its_optional_input() -> RelayState:
    front = group({"/camera/image_raw": IMAGE, "/lidar/points": CLOUD, "/radar/points": CLOUD}, max_wait="100ms")
    front["topics"][2]["required"] = False
    return simulated(file(front=front), {"/camera/image_raw": CAMERA, "/lidar/points": LIDAR})


@cache
def twelve_groups() -> RelayState:
    sensors: dict[str, Sensor] = {}
    groups = {}
    for number in range(1, 13):
        left, right = f"/robot{number}/stereo/left/image_rect_color", f"/robot{number}/stereo/right/image_rect_color"
        groups[f"robot{number}_stereo"] = group({left: IMAGE, right: IMAGE})
        sensors[left] = Sensor(15, jitter_ms=1)
        if number % 5:
            sensors[right] = Sensor(15, jitter_ms=1, shift_ms=30 if number % 4 == 0 else 0)
    return simulated(file(**groups), sensors, seconds=20)


@cache
def sixteen_inputs() -> RelayState:
    topics = {
        f"/vehicle/sensors/surround_view/camera_{number:02}/image_rect_color/compressed": IMAGE for number in range(16)
    }
    sensors = {topic: Sensor(10, lag_ms=20 + number) for number, topic in enumerate(topics)}
    return simulated(file(surround=group(topics)), sensors, seconds=20)


ALL = {
    "healthy": healthy,
    "rig": rig,
    "silent": silent,
    "nothing": nothing,
    "optional": without_its_optional_input,
    "twelve": twelve_groups,
    "sixteen": sixteen_inputs,
}
