"""Messages of /tf and /tf_static, as tf2's broadcasters send them."""

from tests.ros.cdr_messages import STORE, header, serialize
from tests.ros.frames import Frame

TF = "tf2_msgs/msg/TFMessage"


def transforms(topic: str, *edges: tuple[str, str, int], received: int = 0) -> Frame:
    """A message of transforms, each by parent, child and stamp."""
    types = STORE.types
    numbers = types["geometry_msgs/msg/Transform"](
        types["geometry_msgs/msg/Vector3"](1.0, 2.0, 3.0), types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    )
    stamped = types["geometry_msgs/msg/TransformStamped"]
    found = [stamped(header(stamp, parent), child, numbers) for parent, child, stamp in edges]
    return Frame(topic, TF, received, serialize(TF, found))
