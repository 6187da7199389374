"""Units of the fields of common messages, from their definitions and REP 103."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

_M, _RAD, _S = "m", "rad", "s"

# The unit of a member that is a message, such as Imu's angular_velocity, is with the outer message.
_UNITS: Final[Mapping[str, Mapping[str, str]]] = MappingProxyType(
    {
        "builtin_interfaces/msg/Time": {"sec": _S, "nanosec": "ns"},
        "builtin_interfaces/msg/Duration": {"sec": _S, "nanosec": "ns"},
        "geometry_msgs/msg/Point": dict.fromkeys("xyz", _M),
        "geometry_msgs/msg/Point32": dict.fromkeys("xyz", _M),
        "geometry_msgs/msg/Pose2D": {"x": _M, "y": _M, "theta": _RAD},
        "geometry_msgs/msg/Transform": {"translation": _M},
        "geometry_msgs/msg/Twist": {"linear": "m/s", "angular": "rad/s"},
        "geometry_msgs/msg/Accel": {"linear": "m/s^2", "angular": "rad/s^2"},
        "geometry_msgs/msg/Wrench": {"force": "N", "torque": "N.m"},
        "geometry_msgs/msg/Inertia": {"m": "kg", "com": _M},
        "sensor_msgs/msg/BatteryState": {
            "voltage": "V",
            "temperature": "degC",
            "current": "A",
            "charge": "Ah",
            "capacity": "Ah",
            "design_capacity": "Ah",
            "cell_voltage": "V",
            "cell_temperature": "degC",
        },
        "sensor_msgs/msg/FluidPressure": {"fluid_pressure": "Pa", "variance": "Pa^2"},
        "sensor_msgs/msg/Illuminance": {"illuminance": "lx"},
        "sensor_msgs/msg/Imu": {
            "angular_velocity": "rad/s",
            "angular_velocity_covariance": "rad^2/s^2",
            "linear_acceleration": "m/s^2",
            "linear_acceleration_covariance": "m^2/s^4",
            "orientation_covariance": "rad^2",
        },
        "sensor_msgs/msg/LaserScan": {
            **dict.fromkeys(("angle_min", "angle_max", "angle_increment"), _RAD),
            **dict.fromkeys(("time_increment", "scan_time"), _S),
            **dict.fromkeys(("range_min", "range_max", "ranges"), _M),
        },
        "sensor_msgs/msg/MagneticField": {"magnetic_field": "T", "magnetic_field_covariance": "T^2"},
        "sensor_msgs/msg/NavSatFix": {
            "latitude": "deg",
            "longitude": "deg",
            "altitude": _M,
            "position_covariance": "m^2",
        },
        "sensor_msgs/msg/Range": {
            "field_of_view": _RAD,
            **dict.fromkeys(("min_range", "max_range", "range", "variance"), _M),
        },
        "sensor_msgs/msg/RelativeHumidity": {"relative_humidity": "1"},
        "sensor_msgs/msg/Temperature": {"temperature": "degC", "variance": "degC^2"},
    }
)


def unit_of(type_name: str, field: str) -> str | None:
    """Return the unit of a message's field; None if its definition does not fix one."""
    return _UNITS.get(type_name, {}).get(field)
