"""An ament index made by hand: a few interfaces, and one of everything that goes wrong with types."""

from collections.abc import Mapping, Sequence
from pathlib import Path

_INDEX = "share/ament_index/resource_index"

INTERFACES = {
    "builtin_interfaces/msg/Time": "int32 sec\nuint32 nanosec\n",
    "builtin_interfaces/msg/Duration": "int32 sec\nuint32 nanosec\n",
    "std_msgs/msg/Header": "# a comment\nbuiltin_interfaces/Time stamp\n\nstring frame_id\n",
    "std_msgs/msg/String": "string data\n",
    "sensor_msgs/msg/Image": "std_msgs/Header header # as taken\nuint32 height\nuint8[] data\n",
    "sensor_msgs/msg/Imu": "std_msgs/Header header\nfloat64[9] orientation_covariance # row major\n",
    "sensor_msgs/msg/PointCloud2": "uint8 VERSION=2\nstd_msgs/Header header\nuint32 height\n",
    "sensor_msgs/srv/SetCameraInfo": "string camera_info\n---\nbool success\n",
    "geometry_msgs/msg/Point": "float64 x 0\nfloat64 y 0\nfloat64 z 0\n",
    "geometry_msgs/msg/Pose": "Point position\n",
    "std_srvs/srv/Trigger": "---\nbool success\nstring message\n",
    "diagnostic_msgs/msg/DiagnosticArray": "std_msgs/Header header\n",
    "dock_msgs/msg/Status": "uint8 level\nTrigger trigger\nstd_msgs/Header[] past\nstring<=10 name\n",
    "dock_msgs/msg/Trigger": "builtin_interfaces/Time time\nbuiltin_interfaces/Duration exposure\n",
    "dock_msgs/msg/Stereo": "std_msgs/Header header\nsensor_msgs/Image a\nsensor_msgs/Image b\nuint32 number\n",
    "dock_msgs/msg/Headers": "std_msgs/Header[] headers\n",
    "dock_msgs/action/Dock": "---\n---\n",
}
"""Types with the text of their definition."""

WITHOUT_DEFINITION = ("dock_msgs/msg/Opaque",)
"""Installed as .idl only, as packages may be."""

PACKAGES_WITHOUT_INTERFACES = ("rclpy",)


def make_index(prefix: Path) -> Path:
    """Write the index below a prefix and return the prefix."""
    write_index(prefix, INTERFACES, WITHOUT_DEFINITION)
    for package in PACKAGES_WITHOUT_INTERFACES:
        _resource(prefix / _INDEX / "packages" / package, "")
    return prefix


def write_index(prefix: Path, interfaces: Mapping[str, str], without_definition: Sequence[str] = ()) -> Path:
    """Write an index of types, with their definitions or without, below a prefix and return the prefix."""
    listed: dict[str, list[str]] = {}
    for name, text in interfaces.items():
        package, kind, _ = name.split("/")
        listed.setdefault(package, []).append(f"{name.removeprefix(f'{package}/')}.{kind}")
        definition = prefix / "share" / f"{name}.{kind}"
        definition.parent.mkdir(parents=True, exist_ok=True)
        definition.write_text(text)
    for name in without_definition:
        package = name.partition("/")[0]
        listed.setdefault(package, []).append(f"{name.removeprefix(f'{package}/')}.idl")
    for package, files in listed.items():
        _resource(prefix / _INDEX / "rosidl_interfaces" / package, "\n".join(files))
        _resource(prefix / _INDEX / "packages" / package, "")
    return prefix


def _resource(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
