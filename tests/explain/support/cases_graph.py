"""What the graph tells: facts that come to a finding, and the nearest that do not."""

from dataclasses import replace

from syncrelay.explain import BundleGraph, ClockState, Code, Endpoint, GraphSnapshot, Mismatch, Refusal
from syncrelay.sync.counts import InputCounts
from tests.explain.support.cases import AGES, HALF_A_SECOND, LIDAR, ONCE, QUIET, STRANGER, UNFIT, camera
from tests.explain.support.groups import IMAGE, NOW, S, a_group, a_silent_group, an_input

PICKY = Endpoint("/fusion", IMAGE, Mismatch("durability", "volatile", "transient_local"))


def unpublished(alike=None, /, **figures):
    """Inputs that nobody publishes, by their names; nothing came of those without figures."""
    return [
        an_input(f"/{name}", publishers=(), alike=(alike or {}).get(name, ()), figures=each or {"last_received": None})
        for name, each in figures.items()
    ]


# What is said of each stands in tests/explain/findings.txt.
FOUND = {
    "a group that an exception stopped": a_group(failure="KeyError: 'x'"),
    "a group of another package's policy that an exception stopped": a_group(failure="KeyError: 'x'", policy="led_by"),
    "a managed node that waits to be activated": a_silent_group(
        camera(publishers=()), LIDAR, inactive="/robot/syncrelay"
    ),
    "an output whose topic has another type here": a_group(
        camera(refusal=Refusal("publish", "/out", IMAGE, held_as="std_msgs/msg/Int64")), LIDAR
    ),
    "an optional input that the relay cannot subscribe to": a_group(
        camera(required=False, refusal=Refusal("subscribe to", "/camera", IMAGE, why="out of memory")), LIDAR
    ),
    "bundles whose package is not there, and nothing else leaves": a_group(
        bundle=BundleGraph(
            "/set",
            is_alone=True,
            refusal=Refusal(
                "publish", "/set", "rig_msgs/msg/Set", why="No module named 'rig_msgs'\nand more", is_unfit=True
            ),
        )
    ),
    "bundles that cannot be made, beside the outputs": a_group(
        bundle=BundleGraph("/set", refusal=Refusal("publish", "/set", "rig_msgs/msg/Set", why="out of memory"))
    ),
    "a type that is not installed": a_group(camera(not_importable="no package fancy_msgs\nand more"), LIDAR),
    "a field that the type does not have": a_group(
        camera(not_readable="sensor_msgs/msg/Image has no usable field trigger: no such field"), LIDAR
    ),
    "a publisher of another type": a_silent_group(camera(publishers=(STRANGER,)), LIDAR),
    "one publisher of two of another type": a_silent_group(
        camera(publishers=(Endpoint("/driver", IMAGE), STRANGER)), LIDAR
    ),
    "a type that is not installed where another is published": a_group(
        camera(not_importable="no package fancy_msgs", publishers=(STRANGER,)), LIDAR
    ),
    "a publisher of another type than the one that was taken": a_silent_group(
        camera(publishers=(STRANGER,), type_from=Endpoint("/driver", IMAGE)), LIDAR
    ),
    "publishers of two types of a topic without one": a_silent_group(
        camera(type=None, publishers=(Endpoint("/driver", IMAGE), STRANGER)), LIDAR
    ),
    "nobody publishes a topic without a type": a_silent_group(
        camera(type=None, publishers=(), figures={"last_received": None}, alike=("/front/camera",)), LIDAR
    ),
    "nobody publishes": a_silent_group(camera(publishers=(), figures={"last_received": None}), LIDAR),
    "nobody publishes, and a managed node publishes nothing": a_silent_group(
        camera(publishers=(), figures={"last_received": None}, managed=("/usb_cam",)), LIDAR
    ),
    "several are not published, and managed nodes publish nothing": a_silent_group(
        *(
            replace(each, graph=replace(each.graph, managed=tuple(f"/driver{n}" for n in range(5))))
            for each in unpublished(camera={}, lidar={})
        )
    ),
    "nobody publishes, but another name": a_silent_group(
        camera(publishers=(), figures={"last_received": None}, alike=("/cam",)), LIDAR
    ),
    "nobody publishes any more": a_group(camera(publishers=(), figures={"last_received": NOW - 3 * S}), LIDAR),
    "several are not published any more": a_silent_group(
        *unpublished(camera={"last_received": NOW - 9 * S}, lidar={"last_received": NOW - 8 * S})
    ),
    "several are not published": a_silent_group(*unpublished(camera={}, imu={}, lidar={})),
    "several are published under other names": a_silent_group(
        *unpublished({"camera": ("/cam",), "lidar": ("/cam", "/lidar2")}, camera={}, lidar={})
    ),
    "several are published in a namespace": a_silent_group(
        *unpublished({"camera": ("/robot2/camera", "/robot1/camera"), "lidar": ("/robot1/lidar",)}, camera={}, lidar={})
    ),
    "several are published outside of the namespace": a_silent_group(
        *unpublished(
            {"robot1/camera": ("/camera",), "robot1/lidar": ("/lidar",)},
            **{"robot1/camera": {}, "robot1/lidar": {}},
        )
    ),
    "nobody is there": a_silent_group(*unpublished(camera={}, lidar={}), empty_graph=GraphSnapshot(7, "LOCALHOST")),
    "QoS that does not fit": a_silent_group(camera(publishers=(UNFIT,)), LIDAR),
    "QoS of one of two that does not fit": a_silent_group(
        camera(publishers=(UNFIT, Endpoint("/driver", IMAGE))), LIDAR
    ),
    "nobody listens to a lazy group": a_silent_group(asleep=True),
    "nobody listens to a lazy group of which one input is published": a_silent_group(
        camera(publishers=()), LIDAR, asleep=True
    ),
    "a lazy group whose only subscriber gets nothing": a_silent_group(camera(subscribers=(PICKY,)), LIDAR, asleep=True),
    "a clock that stands still": a_silent_group(clock=ClockState(received=True, stopped=4 * S)),
    "nothing came ever": a_silent_group(
        camera(counts=InputCounts(0, 0, {}, 0), figures={**ONCE, "last_received": None}), LIDAR
    ),
    "nothing came ever from a managed node": a_silent_group(
        camera(counts=InputCounts(0, 0, {}, 0), figures={**ONCE, "last_received": None}, managed=("/usb_cam",)), LIDAR
    ),
    "nothing comes any more from a managed node": a_silent_group(camera(figures=QUIET, managed=("/usb_cam",)), LIDAR),
    "nothing came lately": a_silent_group(camera(figures={**ONCE, "last_received": None}), LIDAR),
    "nothing comes any more": a_silent_group(camera(figures=QUIET), LIDAR),
    "something was sent once that only latest_time holds": a_silent_group(camera(figures=ONCE), LIDAR),
    "nothing came for long": a_silent_group(camera(figures={**QUIET, "last_received": NOW - 21 * S}), LIDAR),
    "nothing of what is held comes any more, which always came": a_group(camera(figures=QUIET), LIDAR, **AGES),
    "what was sent once is too old": a_silent_group(
        camera(figures={**ONCE, "last_received": NOW - 60 * S}), LIDAR, **HALF_A_SECOND
    ),
    "a subscriber that gets nothing": a_group(camera(subscribers=(PICKY,)), LIDAR),
    "an output that another node publishes": a_group(
        camera(rivals=(Endpoint("/bag", IMAGE),), rivals_since=NOW - 3 * S), LIDAR
    ),
    "an output that two other nodes publish": a_group(
        camera(rivals=(Endpoint("/bag", IMAGE), Endpoint("/old", IMAGE)), rivals_since=NOW - 9 * S), LIDAR
    ),
    "a bundle that another node publishes": a_group(
        bundle=BundleGraph("/set", rivals=(Endpoint("/bag", IMAGE),), rivals_since=NOW - 3 * S)
    ),
    "an output beside a bundle that another node publishes": a_group(
        camera(rivals=(Endpoint("/bag", IMAGE),), rivals_since=NOW - 3 * S), LIDAR, bundle=BundleGraph("/set")
    ),
    "all inputs that fell silent together": a_silent_group(
        camera(figures=QUIET), an_input("/lidar", figures={**QUIET, "last_received": NOW - 8 * S})
    ),
    "a recording that was paused": a_silent_group(
        camera(figures=QUIET), an_input("/lidar", figures=QUIET), is_recorded=True
    ),
    "an input whose recording stopped": a_silent_group(camera(figures=QUIET), LIDAR, is_recorded=True),
    "no clock at all": a_silent_group(clock=ClockState(received=False, stopped=7 * S)),
}

# By the code that must not be found.
QUIETLY = {
    Code.NO_PUBLISHER: {
        "no publisher while nodes are still being found": a_group(*unpublished(camera={}), LIDAR, is_discovering=True),
    },
    Code.ALONE: {
        "nobody is there while nodes are still being found": a_group(
            *unpublished(camera={}, lidar={}),
            is_discovering=True,
            empty_graph=GraphSnapshot(0, "SUBNET"),
        ),
        "nobody is there any more": a_silent_group(
            *unpublished(camera={"last_received": NOW - 9 * S}, lidar={}), empty_graph=GraphSnapshot(0, "SUBNET")
        ),
    },
    Code.OTHER_TYPE: {
        "a type that is not known yet is no other type": a_silent_group(
            camera(type=None, publishers=(Endpoint("/driver", IMAGE), STRANGER)), LIDAR
        ),
        "who publishes another type than one that cannot be used is told with that": a_silent_group(
            camera(not_importable="no package fancy_msgs", publishers=(STRANGER,)), LIDAR
        ),
    },
    Code.SEVERAL_TYPES: {
        "one type of a topic without one is no two": a_silent_group(
            camera(type=None, publishers=(Endpoint("/a", IMAGE), Endpoint("/b", IMAGE))), LIDAR
        ),
    },
    Code.INCOMPATIBLE_QOS: {
        "another type is no QoS": a_silent_group(camera(publishers=(STRANGER,)), LIDAR),
    },
    Code.SILENT: {
        "what nobody publishes is not silent": a_silent_group(camera(publishers=(), figures=QUIET), LIDAR),
        "what does not fit is not silent": a_silent_group(camera(publishers=(UNFIT,), figures=QUIET), LIDAR),
        "silence while /clock stands": a_silent_group(
            camera(figures=QUIET), LIDAR, clock=ClockState(received=True, stopped=4 * S)
        ),
        "a slow input between two messages": a_group(
            camera(figures={"rate_hz": 0.1, "last_received": NOW - 9 * S}), LIDAR, figures={"best_hz": 0.1}
        ),
        "a map that was sent once, long ago": a_group(camera(figures=ONCE), LIDAR, **AGES),
        "a state that is sent at odds": a_group(
            camera(figures={**QUIET, "usual_hz": 3.0, "longest_pause": 4 * S}), LIDAR, **AGES
        ),
    },
}
