"""Rigs whose nodes are missing, die, or come back as others."""

from tests.scenarios.play import Scenario
from tests.scenarios.rigs_flow import CAMERA, LIDAR, RECOVERED
from tests.scenarios.streams import POINT, Stream

RIGS = {
    # Point 5: several topics missing at once, published in another namespace.
    "elsewhere": Scenario(
        streams=[
            Stream("/robot1/elsewhere/camera", 5),
            Stream("/robot1/elsewhere/lidar", 5),
        ],
        listens_to=["camera", "lidar"],
        first="no_publisher",
        says=r"(?=.*/elsewhere/camera)(?=.*/elsewhere/lidar)(?=.*/robot1)",
        heals=False,
    ),
    "lidar_dies": Scenario(
        streams=[Stream("camera", 10, **CAMERA), Stream("lidar", 10, "13", **LIDAR)],
        first="no_publisher",
        says=r"/lidar_dies/lidar",
        never_says=r"since [\d.]+ s",
        over=RECOVERED,
    ),
    "camera_returns_best_effort": Scenario(
        streams=[
            Stream("camera", 10, "1", **CAMERA),
            Stream("camera", 10, "23", reliability="best_effort", **CAMERA),
            Stream("lidar", 10, **LIDAR),
        ],
        inputs={"camera": {"qos": {"reliability": "reliable"}}},
        first="incompatible_qos",
        says=r"_best_effort/camera_driver .*best_effort.*`qos: auto` at /camera_returns_best_effort/camera",
        cure=["qos"],
    ),
    "camera_returns_as_points": Scenario(
        streams=[
            Stream("camera", 10, "1", **CAMERA),
            Stream("camera", 10, "23", type=POINT, **CAMERA),
            Stream("lidar", 10, **LIDAR),
        ],
        first="other_type",
        says=r"/camera_returns_as_points/camera_driver publishes .* as geometry_msgs/msg/PointStamped",
        cure=["type"],
    ),
}
