"""Rigs whose messages come too slowly, too late, at once, or not at all; and rigs in which all is well."""

from tests.scenarios.play import Scenario
from tests.scenarios.streams import OnItsGrid, Stream

# A driver's samples are a little off their place, and a lidar's are not those of the camera.
CAMERA: OnItsGrid = {"wobble_ms": 1}
LIDAR: OnItsGrid = {"phase_ms": 7, "wobble_ms": 1}

RECOVERED = r"recovered after [\d.]+ s"

RIGS = {
    "well": Scenario(streams=[Stream("camera", 30, **CAMERA), Stream("lidar", 10, **LIDAR)]),
    "well_with_map": Scenario(
        streams=[
            Stream("camera", 10, **CAMERA),
            # Sent once, long after its stamp.
            Stream("map", 0.005, durability="transient_local", shift_ms=-3000),
        ],
        options={"policy": "latest_time", "trigger": "/well_with_map/camera"},
        inputs={"map": {"qos": {"durability": "transient_local"}}},
    ),
    # Point 4: a rate that halves.
    "camera_halves": Scenario(
        streams=[
            Stream("camera", 30, "13", **CAMERA),
            Stream("camera", 15, "2", **CAMERA),
            Stream("lidar", 10, **LIDAR),
        ],
        first="slowed",
        says=r"/camera_halves/camera has slowed from (29|3[01])[\d.]* Hz to 1[3-6][\d.]* Hz; check"
        r" /camera_halves/camera_driver: its settings, its load, and the network to it$",
        over=r"^camera_halves: resolved [\d.]+ (s|min) ago: /camera_halves/camera has slowed",
    ),
    "lidar_halves": Scenario(
        streams=[
            Stream("camera", 30, **CAMERA),
            Stream("lidar", 10, "13", **LIDAR),
            Stream("lidar", 5, "2", **LIDAR),
        ],
        first="slowed",
        says=r"/lidar_halves/lidar has slowed from (9|10)[\d.]* Hz to [45][\d.]* Hz",
    ),
    # Point 7: what `queue_size` is to hold.
    "late_camera": Scenario(
        streams=[Stream("camera", 5, late_ms=700, jitter_ms=60), Stream("imu", 100)],
        options={"slop": "10ms"},
        first="short_queue",
        says=r"/late_camera/imu .*`queue_size: \d+`",
        cure=["queue_size"],
    ),
    # Point 9: a player that stands still, and a bridge that sends in batches.
    "all_in_batches": Scenario(
        streams=[Stream("camera", 10, batch_ms=1200), Stream("lidar", 10, batch_ms=1200, **LIDAR)],
        options={"queue_size": 50},
        first="bursts",
        never_says=r"network|loses|packet",
        heals=False,
    ),
    "one_in_batches": Scenario(
        streams=[Stream("camera", 10, batch_ms=1200), Stream("lidar", 10, **LIDAR)],
        options={"queue_size": 50},
        first="bursts",
        says=r"/one_in_batches/camera",
        never_says=r"loses packets|queue_size|slop",
        heals=False,
    ),
    # Point 11: an optional input that comes late.
    "late_radar": Scenario(
        streams=[
            Stream("camera", 10, **CAMERA),
            Stream("lidar", 10, **LIDAR),
            Stream("radar", 10, late_ms=250, jitter_ms=15),
        ],
        inputs={"radar": {"required": False}},
        options={"max_wait": "100ms"},
        first="waiting_for_optional",
        says=r"/late_radar/radar.*`max_wait: \d+ms`",
        cure=["max_wait"],
    ),
    "lidar_silent": Scenario(
        streams=[
            Stream("camera", 10, **CAMERA),
            Stream("lidar", 10, "13", **LIDAR),
            Stream("lidar", 0, "2", **LIDAR),
        ],
        first="silent",
        says=r"no more sets for [\d.]+ (s|min): /lidar_silent/lidar has been silent for [\d.]+ (s|min); before that its"
        r" rate was [\d.]+ Hz; check /lidar_silent/lidar_driver, which publishes it or has died: a dead node stays in"
        r" the graph for 20 s$",
        over=RECOVERED,
    ),
    # A recorder that pauses.
    "all_silent": Scenario(
        streams=[Stream("camera", hz, acts) for hz, acts in ((10, "13"), (0, "2"))]
        + [Stream("lidar", hz, acts, **LIDAR) for hz, acts in ((10, "13"), (0, "2"))],
        first="silent",
        says=r"/all_silent/camera.*/all_silent/lidar|all inputs",
        over=RECOVERED,
    ),
}
