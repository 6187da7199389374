"""What sets lacked that could not be transformed: facts that come to a finding, and the nearest that do not."""

from dataclasses import replace

from syncrelay.config import TransformsConfig
from syncrelay.explain import Code, Endpoint, Mismatch
from syncrelay.sync import DropReason, Lack, Lapse, Missing
from tests.explain.support.cases import LIDAR, camera, dropped
from tests.explain.support.groups import MS, S, a_group, a_silent_group

TRANSFORMS = TransformsConfig.model_validate({"target": "base_link", "wait": "100ms"})


def given_up(lack, *, parent="odom", child="base_link", by=0, needed=(), count=30, group=a_group, **facts):
    """A group of which the last 30 sets were given up, for one reason; some of them could leave after a longer wait."""
    lapse = Lapse(0, Missing(lack, parent, child, by))
    followed = [replace(lapse, needed_ns=each, covered=number * 100 * MS) for number, each in enumerate(needed)]
    inputs = camera(figures={"dropped": {DropReason.NO_TRANSFORM: count}}), LIDAR
    return group(*inputs, transforms=TRANSFORMS, lapses=(*[lapse] * count, *followed), **facts)


# What is said of each stands in tests/explain/findings.txt.
FOUND = {
    "a transform that comes late": given_up(Lack.LATE, by=80 * MS, needed=[170 * MS, 180 * MS, 150 * MS]),
    "a transform that comes late, and no set leaves": given_up(
        Lack.LATE, by=80 * MS, needed=[180 * MS] * 3, group=a_silent_group
    ),
    "a transform that comes too late for any wait": given_up(Lack.LATE, by=11 * S, needed=[12 * S]),
    "a transform that was away for a while": given_up(
        Lack.LATE, by=3 * S, needed=[3 * S - n * 100 * MS for n in range(20)], count=20
    ),
    "a transform that has stopped": given_up(Lack.LATE, by=7 * S),
    "a transform of which nothing came since the clock jumped back": given_up(Lack.LATE),
    "more sets than can wait": given_up(
        Lack.LATE, by=20 * MS, needed=[90 * MS] * 2, queue_size=2, figures={"best_hz": 100.0}
    ),
    "a transform that began after the message": given_up(Lack.PAST, by=300 * MS, count=1, group=a_silent_group),
    "a frame that no transform names": given_up(Lack.UNKNOWN_FRAME, parent="base_link", child="camera_lens"),
    "a frame whose publisher does not offer what tf2 requests": given_up(
        Lack.UNKNOWN_FRAME,
        parent="base_link",
        child="camera_lens",
        unheard=[("/tf_static", Endpoint("/urdf", "", Mismatch("durability", "volatile", "transient_local")))],
    ),
    "a target that no transform names": given_up(Lack.UNKNOWN_FRAME, parent="base_link", child="base_link"),
    "two trees": given_up(Lack.UNCONNECTED, parent="base_link", child="camera_lens"),
    "a loop of transforms": given_up(Lack.LOOP, parent="base_link", child="odom"),
    "messages with a frame_id of ROS 1": given_up(Lack.NO_FRAME, parent="base_link", child="/laser"),
    "messages with an empty frame_id": given_up(Lack.NO_FRAME, parent="base_link", child=""),
}
QUIETLY = {
    Code.NO_TRANSFORM: {
        "sets that were given up a while ago": a_group(
            camera(), LIDAR, transforms=TRANSFORMS, lapses=[Lapse(0, Missing(Lack.LATE, "odom", "base_link", MS))]
        ),
        "the first messages, older than the first transforms": given_up(Lack.PAST, by=300 * MS, count=2),
        "a frame that a transform names by now": given_up(
            Lack.UNKNOWN_FRAME, parent="base_link", child="camera_lens", needed=[2 * S, S], count=2
        ),
        "messages that were dropped for another reason": a_group(
            dropped(DropReason.LATE, 30), LIDAR, transforms=TRANSFORMS
        ),
    },
}
