"""What the graph tells: facts that come to a finding, and the nearest that do not."""

from syncrelay.explain import ClockState, Code, Endpoint, GraphSnapshot, Mismatch, Refusal, Severity
from syncrelay.sync.counts import InputCounts
from tests.explain.support.cases import AGES, HALF_A_SECOND, LIDAR, ONCE, QUIET, STRANGER, UNFIT, camera
from tests.explain.support.groups import IMAGE, MS, NOW, S, a_group, a_silent_group, an_input

PICKY = Endpoint("/fusion", IMAGE, Mismatch("durability", "volatile", "transient_local"))


def unpublished(alike=None, /, **figures):
    """Inputs that nobody publishes, by their names; nothing came of those without figures."""
    return [
        an_input(f"/{name}", publishers=(), alike=(alike or {}).get(name, ()), figures=each or {"last_received": None})
        for name, each in figures.items()
    ]


# Code, severity, facts, sentence, suggestion.
FOUND = {
    "a group that an exception stopped": (
        Code.INTERNAL_ERROR,
        Severity.ERROR,
        a_group(failure="KeyError: 'x'"),
        "a bug in syncrelay stopped this group: KeyError: 'x'",
        "report it with the traceback in the log; `syncrelay reload` starts the group again",
    ),
    "a group of another package's policy that an exception stopped": (
        Code.INTERNAL_ERROR,
        Severity.ERROR,
        a_group(failure="KeyError: 'x'", policy="led_by"),
        "a bug in syncrelay or in the package of the policy `led_by` stopped this group: KeyError: 'x'",
        "report it with the traceback in the log; `syncrelay reload` starts the group again",
    ),
    "a managed node that waits to be activated": (
        Code.INACTIVE,
        Severity.WARN,
        a_silent_group(camera(publishers=()), LIDAR, inactive="/robot/syncrelay"),
        "the node is inactive: it receives and publishes nothing",
        "activate it with `ros2 lifecycle set /robot/syncrelay activate`",
    ),
    "an output whose topic has another type here": (
        Code.REFUSED_BY_DDS,
        Severity.ERROR,
        a_group(camera(refusal=Refusal("publish", "/out", IMAGE, held_as="std_msgs/msg/Int64")), LIDAR),
        f"the relay cannot publish /out as {IMAGE}: this process has it as std_msgs/msg/Int64 already",
        "give one of the two another name: a process has one type for each topic",
    ),
    "an optional input that the relay cannot subscribe to": (
        Code.REFUSED_BY_DDS,
        Severity.WARN,
        a_group(camera(required=False, refusal=Refusal("subscribe to", "/camera", IMAGE, why="out of memory")), LIDAR),
        f"the relay cannot subscribe to /camera as {IMAGE}: out of memory",
        "the relay tries again every 5 s; if this goes on, check the limits on memory and open files",
    ),
    "a type that is not installed": (
        Code.TYPE_NOT_IMPORTABLE,
        Severity.ERROR,
        a_group(camera(not_importable="no package fancy_msgs\nand more"), LIDAR),
        "/camera: no package fancy_msgs",
        "install the package where the relay runs, or source the workspace that has it",
    ),
    "a field that the type does not have": (
        Code.TYPE_NOT_IMPORTABLE,
        Severity.ERROR,
        a_group(camera(not_readable="sensor_msgs/msg/Image has no usable field trigger: no such field"), LIDAR),
        "/camera: sensor_msgs/msg/Image has no usable field trigger: no such field",
        "name a field that it has at `stamp` or `key`, or write `stamp: receive`, then `syncrelay reload`",
    ),
    "a publisher of another type": (
        Code.OTHER_TYPE,
        Severity.ERROR,
        a_silent_group(camera(publishers=(STRANGER,)), LIDAR),
        f"/usb_cam publishes /camera as std_msgs/msg/Int64, the file says {IMAGE}",
        "write `type: std_msgs/msg/Int64`",
    ),
    "one publisher of two of another type": (
        Code.OTHER_TYPE,
        Severity.WARN,
        a_silent_group(camera(publishers=(Endpoint("/driver", IMAGE), STRANGER)), LIDAR),
        f"/usb_cam publishes /camera as std_msgs/msg/Int64, the file says {IMAGE}",
        "have /usb_cam use another topic",
    ),
    "a type that is not installed where another is published": (
        Code.TYPE_NOT_IMPORTABLE,
        Severity.ERROR,
        a_group(camera(not_importable="no package fancy_msgs", publishers=(STRANGER,)), LIDAR),
        "/camera: no package fancy_msgs; /usb_cam publishes it as std_msgs/msg/Int64",
        "write `type: std_msgs/msg/Int64`, or leave `type` out",
    ),
    "a publisher of another type than the one that was taken": (
        Code.OTHER_TYPE,
        Severity.ERROR,
        a_silent_group(camera(publishers=(STRANGER,), type_from=Endpoint("/driver", IMAGE)), LIDAR),
        f"/usb_cam publishes /camera as std_msgs/msg/Int64, the relay took {IMAGE} from /driver",
        "restart the relay, or write `type: std_msgs/msg/Int64` and `syncrelay reload`",
    ),
    "publishers of two types of a topic without one": (
        Code.SEVERAL_TYPES,
        Severity.ERROR,
        a_silent_group(camera(type=None, publishers=(Endpoint("/driver", IMAGE), STRANGER)), LIDAR),
        f"/camera is published with 2 types: {IMAGE} by /driver and std_msgs/msg/Int64 by /usb_cam",
        "write the `type` that is meant, or have only one of them publish it",
    ),
    "nobody publishes a topic without a type": (
        Code.NO_PUBLISHER,
        Severity.ERROR,
        a_silent_group(
            camera(type=None, publishers=(), figures={"last_received": None}, alike=("/front/camera",)), LIDAR
        ),
        "nobody publishes /camera",
        "did you mean `topic: /front/camera`?",
    ),
    "nobody publishes": (
        Code.NO_PUBLISHER,
        Severity.ERROR,
        a_silent_group(camera(publishers=(), figures={"last_received": None}), LIDAR),
        f"nobody publishes /camera ({IMAGE})",
        "start the node that publishes /camera, or correct the topic's name",
    ),
    "nobody publishes, but another name": (
        Code.NO_PUBLISHER,
        Severity.ERROR,
        a_silent_group(camera(publishers=(), figures={"last_received": None}, alike=("/cam",)), LIDAR),
        f"nobody publishes /camera ({IMAGE})",
        f"did you mean `topic: /cam`? It is published as {IMAGE}",
    ),
    "nobody publishes any more": (
        Code.NO_PUBLISHER,
        Severity.WARN,
        a_group(camera(publishers=(), figures={"last_received": NOW - 3 * S}), LIDAR),
        f"nobody publishes /camera ({IMAGE}) any more; its last message arrived 3 s ago",
        "restart the node that published /camera",
    ),
    "several are not published any more": (
        Code.NO_PUBLISHER,
        Severity.ERROR,
        a_silent_group(*unpublished(camera={"last_received": NOW - 9 * S}, lidar={"last_received": NOW - 8 * S})),
        "nobody publishes /camera or /lidar any more; the last message arrived 8 s ago",
        "restart the nodes that published them",
    ),
    "several are not published": (
        Code.NO_PUBLISHER,
        Severity.ERROR,
        a_silent_group(*unpublished(camera={}, imu={}, lidar={})),
        "nobody publishes /camera, /imu or /lidar",
        "start the nodes that publish them, or correct the topics' names",
    ),
    "several are published under other names": (
        Code.NO_PUBLISHER,
        Severity.ERROR,
        a_silent_group(*unpublished({"camera": ("/cam",), "lidar": ("/cam", "/lidar2")}, camera={}, lidar={})),
        "nobody publishes /camera or /lidar",
        (
            "did you mean /cam for /camera and /lidar2 for /lidar? Otherwise start the nodes that publish them,"
            " or correct the topics' names"
        ),
    ),
    "several are published in a namespace": (
        Code.NO_PUBLISHER,
        Severity.ERROR,
        a_silent_group(
            *unpublished(
                {"camera": ("/robot2/camera", "/robot1/camera"), "lidar": ("/robot1/lidar",)}, camera={}, lidar={}
            )
        ),
        "nobody publishes /camera or /lidar",
        "/robot1/camera and /robot1/lidar are published; did you mean namespace /robot1?",
    ),
    "several are published outside of the namespace": (
        Code.NO_PUBLISHER,
        Severity.ERROR,
        a_silent_group(
            *unpublished(
                {"robot1/camera": ("/camera",), "robot1/lidar": ("/lidar",)},
                **{"robot1/camera": {}, "robot1/lidar": {}},
            )
        ),
        "nobody publishes /robot1/camera or /robot1/lidar",
        "/camera and /lidar are published; did you mean namespace /?",
    ),
    "nobody is there": (
        Code.ALONE,
        Severity.ERROR,
        a_silent_group(*unpublished(camera={}, lidar={}), empty_graph=GraphSnapshot(7, "LOCALHOST")),
        "no other node was found on domain 7 (discovery range LOCALHOST)",
        (
            "start the robot's nodes; if they are running, compare ROS_DOMAIN_ID, ROS_AUTOMATIC_DISCOVERY_RANGE and"
            " RMW_IMPLEMENTATION on both sides, and run `syncrelay doctor --live`"
        ),
    ),
    "QoS that does not fit": (
        Code.INCOMPATIBLE_QOS,
        Severity.ERROR,
        a_silent_group(camera(publishers=(UNFIT,)), LIDAR),
        "/usb_cam offers /camera with reliability best_effort, the group requests reliable",
        "write `qos: auto` at /camera, or have /usb_cam offer reliable",
    ),
    "QoS of one of two that does not fit": (
        Code.INCOMPATIBLE_QOS,
        Severity.WARN,
        a_silent_group(camera(publishers=(UNFIT, Endpoint("/driver", IMAGE))), LIDAR),
        "/usb_cam offers /camera with reliability best_effort, the group requests reliable",
        "write `qos: auto` at /camera, or have /usb_cam offer reliable",
    ),
    "nobody listens to a lazy group": (
        Code.NOBODY_LISTENS,
        Severity.OK,
        a_silent_group(asleep=True),
        "nobody subscribes to /front/camera or /front/lidar, so this lazy group receives nothing",
        None,
    ),
    "nobody listens to a lazy group of which one input is published": (
        Code.NOBODY_LISTENS,
        Severity.OK,
        a_silent_group(camera(publishers=()), LIDAR, asleep=True),
        "nobody subscribes to /front/lidar, so this lazy group receives nothing",
        None,
    ),
    "a lazy group whose only subscriber gets nothing": (
        Code.NOBODY_LISTENS,
        Severity.OK,
        a_silent_group(camera(subscribers=(PICKY,)), LIDAR, asleep=True),
        (
            "no subscriber of /front/camera or /front/lidar fits what the relay offers,"
            " so this lazy group receives nothing"
        ),
        None,
    ),
    "a clock that stands still": (
        Code.CLOCK_STOPPED,
        Severity.ERROR,
        a_silent_group(clock=ClockState(received=True, stopped=4 * S)),
        "/clock has stood still for 4 s: nothing that waits expires",
        "start or resume what publishes /clock, or run without use_sim_time",
    ),
    "nothing came ever": (
        Code.SILENT,
        Severity.ERROR,
        a_silent_group(camera(counts=InputCounts(0, 0, {}, 0), figures={**ONCE, "last_received": None}), LIDAR),
        "/usb_cam publishes /camera, but no message has arrived",
        (
            "check with `ros2 topic hz /camera` whether /usb_cam is sending; if so, run `syncrelay doctor --config FILE"
            " --live`"
        ),
    ),
    "nothing comes any more": (
        Code.SILENT,
        Severity.ERROR,
        a_silent_group(camera(figures=QUIET), LIDAR),
        "/camera has been silent for 7 s; before that its rate was 10 Hz",
        "check /usb_cam, which publishes it or has died: a dead node stays in the graph for 20 s",
    ),
    "nothing came for long": (
        Code.SILENT,
        Severity.ERROR,
        a_silent_group(camera(figures={**QUIET, "last_received": NOW - 21 * S}), LIDAR),
        "/camera has been silent for 21 s; before that its rate was 10 Hz",
        "check /usb_cam, which still publishes it",
    ),
    "nothing of what is held comes any more, which always came": (
        Code.SILENT,
        Severity.WARN,
        a_group(camera(figures=QUIET), LIDAR, **AGES),
        "/camera has been silent for 7 s; before that its rate was 10 Hz",
        "check /usb_cam, which publishes it or has died: a dead node stays in the graph for 20 s",
    ),
    "what was sent once is too old": (
        Code.SILENT,
        Severity.ERROR,
        a_silent_group(camera(figures={**ONCE, "last_received": NOW - 60 * S}), LIDAR, **HALF_A_SECOND),
        "/camera has been silent for 60 s",
        (
            "check /usb_cam, which still publishes it; if it is meant to be sent this rarely, write a `max_age` larger"
            " than 500 ms for it"
        ),
    ),
    "a subscriber that gets nothing": (
        Code.SUBSCRIBER_QOS,
        Severity.WARN,
        a_group(
            camera(subscribers=(PICKY,)),
            LIDAR,
        ),
        "/fusion requests /front/camera with durability transient_local, the relay offers volatile, so it gets nothing",
        "have /fusion request volatile, or /camera's publisher offer transient_local",
    ),
    "an output that another node publishes": (
        Code.OUTPUT_TAKEN,
        Severity.WARN,
        a_group(camera(rivals=(Endpoint("/bag", IMAGE),), rivals_since=NOW - 3 * S), LIDAR),
        "/bag publishes /front/camera too: its subscribers get the messages of both",
        (
            "stop all publishers but one, or give this output another name with `output: ...`; a node that was killed"
            " stays in the graph for 20 s"
        ),
    ),
    "an output that two other nodes publish": (
        Code.OUTPUT_TAKEN,
        Severity.WARN,
        a_group(camera(rivals=(Endpoint("/bag", IMAGE), Endpoint("/old", IMAGE)), rivals_since=NOW - 9 * S), LIDAR),
        "/bag and /old publish /front/camera too: its subscribers get the messages of all",
        (
            "stop all publishers but one, or give this output another name with `output: ...`; a node that was killed"
            " stays in the graph for 20 s"
        ),
    ),
}

FOUND |= {
    "all inputs that fell silent together": (
        Code.SILENT,
        Severity.ERROR,
        a_silent_group(camera(figures=QUIET), an_input("/lidar", figures={**QUIET, "last_received": NOW - 8 * S})),
        "all inputs have been silent for 7 s",
        "check whether their publishers are still running, and the network to them",
    ),
    "a recording that was paused": (
        Code.SILENT,
        Severity.ERROR,
        a_silent_group(camera(figures=QUIET), an_input("/lidar", figures=QUIET), is_recorded=True),
        "all inputs have been silent for 7 s",
        "check whether recording was paused",
    ),
    "no clock at all": (
        Code.NO_CLOCK,
        Severity.ERROR,
        a_silent_group(clock=ClockState(received=False, stopped=7 * S)),
        "no /clock has been received for 7 s, and the relay runs with use_sim_time: nothing that waits expires",
        "start what publishes /clock, such as `ros2 bag play --clock`, or run without use_sim_time",
    ),
}

# The code that must not be found, facts.
QUIETLY = {
    "another relay that is about to end": (
        Code.OUTPUT_TAKEN,
        a_group(camera(rivals=(Endpoint("/syncrelay", IMAGE),), rivals_since=NOW - 2900 * MS), LIDAR),
    ),
    "no publisher while nodes are still being found": (
        Code.NO_PUBLISHER,
        a_group(*unpublished(camera={}), LIDAR, is_discovering=True),
    ),
    "nobody is there while nodes are still being found": (
        Code.ALONE,
        a_group(
            *unpublished(camera={}, lidar={}),
            is_discovering=True,
            empty_graph=GraphSnapshot(0, "SUBNET"),
        ),
    ),
    "nobody is there any more": (
        Code.ALONE,
        a_silent_group(
            *unpublished(camera={"last_received": NOW - 9 * S}, lidar={}), empty_graph=GraphSnapshot(0, "SUBNET")
        ),
    ),
    "a type that is not known yet is no other type": (
        Code.OTHER_TYPE,
        a_silent_group(camera(type=None, publishers=(Endpoint("/driver", IMAGE), STRANGER)), LIDAR),
    ),
    "one type of a topic without one is no two": (
        Code.SEVERAL_TYPES,
        a_silent_group(camera(type=None, publishers=(Endpoint("/a", IMAGE), Endpoint("/b", IMAGE))), LIDAR),
    ),
    "who publishes another type than one that cannot be used is told with that": (
        Code.OTHER_TYPE,
        a_silent_group(camera(not_importable="no package fancy_msgs", publishers=(STRANGER,)), LIDAR),
    ),
    "another type is no QoS": (Code.INCOMPATIBLE_QOS, a_silent_group(camera(publishers=(STRANGER,)), LIDAR)),
    "what nobody publishes is not silent": (Code.SILENT, a_silent_group(camera(publishers=(), figures=QUIET), LIDAR)),
    "what does not fit is not silent": (Code.SILENT, a_silent_group(camera(publishers=(UNFIT,), figures=QUIET), LIDAR)),
    "silence while /clock stands": (
        Code.SILENT,
        a_silent_group(camera(figures=QUIET), LIDAR, clock=ClockState(received=True, stopped=4 * S)),
    ),
    "a slow input between two messages": (
        Code.SILENT,
        a_group(camera(figures={"rate_hz": 0.1, "last_received": NOW - 9 * S}), LIDAR, figures={"best_hz": 0.1}),
    ),
    "a map that was sent once, long ago": (Code.SILENT, a_group(camera(figures=ONCE), LIDAR, **AGES)),
    "a state that is sent at odds": (
        Code.SILENT,
        a_group(camera(figures={**QUIET, "usual_hz": 3.0, "longest_pause": 4 * S}), LIDAR, **AGES),
    ),
}
