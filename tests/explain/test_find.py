"""Every finding: facts that come to it, with its sentence and its suggestion, and the nearest facts that don't."""

import pytest
from groups import BEGAN, IMAGE, MS, NOW, S, a_group, a_silent_group, an_input

from syncrelay.explain import Code, Distribution, Endpoint, Finding, Mismatch, Severity, Tolerance, explanation, find
from syncrelay.explain.drift import Drift
from syncrelay.sync.counts import InputCounts
from syncrelay.sync.messages import DropReason

LIDAR = an_input("/lidar")
UNFIT = Endpoint("/usb_cam", IMAGE, Mismatch("reliability", "best_effort", "reliable"))
STRANGER = Endpoint("/usb_cam", "std_msgs/msg/Int64")
QUIET = {"rate_hz": 0.0, "last_received": NOW - 7 * S, "fed": 0}
ONCE = {**QUIET, "usual_hz": 0.0, "longest_pause": 0}
AGES = {"policy": "latest_time", "trigger": 1, "tolerance": None}
HALF_A_SECOND = {**AGES, "tolerance": Tolerance("max_age", 500 * MS)}


def camera(**facts):
    return an_input("/camera", node="/usb_cam", **facts)


def dropped(reason, count, *, fed=100, **figures):
    return camera(figures={"dropped": {reason: count}, "fed": fed, **figures})


def fed(*, needed_queue=None):
    return InputCounts(600, 0, {}, 10, needed_queue)


def overflowing(needed):
    figures = {"dropped": {DropReason.OVERFLOW: 90}}
    return camera(counts=fed(needed_queue=needed), figures=figures)


def wide(*spans_ms, **figures):
    spans = Distribution([round(each * MS) for each in spans_ms])
    return {"nearest": spans, "nearest_since": spans, **figures}


def without_camera(**figures):
    inputs = camera(required=False, figures=figures), LIDAR, an_input("/imu")
    return a_group(*inputs, figures={"missing": (1.0, 0.0, 0.0)}, max_wait=100 * MS)


def drifting(slope, *, watched=60 * S, bend=0.0):
    return camera(figures={"drift": Drift(slope, bend, watched)})


STEADY = an_input("/lidar", figures={"drift": Drift(0.0, 0.0, 60 * S)})

# Code, severity, facts, sentence, suggestion.
FOUND = {
    "a type that is not installed": (
        Code.TYPE_NOT_IMPORTABLE,
        Severity.ERROR,
        a_group(camera(not_importable="no package fancy_msgs\nand more"), LIDAR),
        "/camera: no package fancy_msgs",
        "install the package where the relay runs, or source the workspace that has it",
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
        f"nobody publishes /camera ({IMAGE}) any more, since 3 s",
        "restart the node that published /camera",
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
    "a clock that stands still": (
        Code.CLOCK_STOPPED,
        Severity.ERROR,
        a_silent_group(clock_stopped=4 * S),
        "/clock has stood still for 4 s: nothing that waits expires",
        "start or resume what publishes /clock, or run without use_sim_time",
    ),
    "nothing came ever": (
        Code.SILENT,
        Severity.ERROR,
        a_silent_group(camera(counts=InputCounts(0, 0, {}, 0), figures={**ONCE, "last_received": None}), LIDAR),
        "/usb_cam publishes /camera, but no message has come",
        "see with `ros2 topic hz /camera` whether /usb_cam sends; if it does, ask `syncrelay doctor`",
    ),
    "nothing comes any more": (
        Code.SILENT,
        Severity.ERROR,
        a_silent_group(camera(figures=QUIET), LIDAR),
        "/camera has been silent for 7 s; until then it came at 10 Hz",
        "look at /usb_cam, which publishes it, or died: the graph shows a dead node for 20 s",
    ),
    "nothing came for long": (
        Code.SILENT,
        Severity.ERROR,
        a_silent_group(camera(figures={**QUIET, "last_received": NOW - 21 * S}), LIDAR),
        "/camera has been silent for 21 s; until then it came at 10 Hz",
        "look at /usb_cam, which still publishes it",
    ),
    "nothing of what is held comes any more, which always came": (
        Code.SILENT,
        Severity.WARN,
        a_group(camera(figures=QUIET), LIDAR, **AGES),
        "/camera has been silent for 7 s; until then it came at 10 Hz",
        "look at /usb_cam, which publishes it, or died: the graph shows a dead node for 20 s",
    ),
    "what was sent once is too old": (
        Code.SILENT,
        Severity.ERROR,
        a_silent_group(camera(figures={**ONCE, "last_received": NOW - 60 * S}), LIDAR, **HALF_A_SECOND),
        "/camera has been silent for 60 s",
        (
            "look at /usb_cam, which still publishes it; if it is sent that rarely by design, write a larger `max_age`"
            " than 500 ms, or none"
        ),
    ),
    "messages that are cut short": (
        Code.MALFORMED,
        Severity.ERROR,
        a_silent_group(dropped(DropReason.MALFORMED, 100), LIDAR),
        "all 100 messages of /camera are cut short, or not of its type",
        f"see that /usb_cam has the same version of {IMAGE} as is installed here",
    ),
    "a few messages that are cut short explain no silence": (
        Code.MALFORMED,
        Severity.WARN,
        a_silent_group(dropped(DropReason.MALFORMED, 3), LIDAR),
        "3 of the last 100 messages of /camera are cut short, or not of its type",
        f"see that /usb_cam has the same version of {IMAGE} as is installed here",
    ),
    "stamps of 0": (
        Code.UNSTAMPED,
        Severity.ERROR,
        a_silent_group(dropped(DropReason.UNSTAMPED, 100, delay=None), LIDAR),
        "all 100 messages of /camera have stamp 0",
        "have /usb_cam set header.stamp, or write `stamp: receive` at /camera",
    ),
    "stamps of another clock": (
        Code.OTHER_CLOCK,
        Severity.ERROR,
        a_silent_group(camera(figures={"delay": 37_205 * MS}), LIDAR),
        "stamps of /camera are 37.2 s behind those of /lidar",
        "synchronize the clocks of their machines, or write `offset: 37.2s` at /camera",
    ),
    "stamps of a clock that is ahead": (
        Code.OTHER_CLOCK,
        Severity.ERROR,
        a_silent_group(camera(figures={"delay": -1_995 * MS}), LIDAR, an_input("/imu")),
        "stamps of /camera are 2 s ahead of those of the other inputs",
        "synchronize the clocks of their machines, or write `offset: -2s` at /camera",
    ),
    "an offset that is wrong": (
        Code.OTHER_CLOCK,
        Severity.ERROR,
        a_silent_group(camera(offset=-1500 * MS, figures={"delay": 5 * MS}), LIDAR),
        "stamps of /camera, with its offset of -1.5s, are 1.5 s behind those of /lidar",
        "synchronize the clocks of their machines, or write `offset: 0ms` at /camera",
    ),
    "a result that may only come late": (
        Code.OTHER_CLOCK,
        Severity.ERROR,
        a_silent_group(camera(figures={"delay": 1505 * MS}), an_input("/lidar", counts=fed(needed_queue=16))),
        "stamps of /camera are 1.5 s behind those of /lidar",
        (
            "synchronize the clocks of their machines, or write `offset: 1.5s` at /camera; if /camera really takes that"
            " long to come, write `queue_size: 16`"
        ),
    ),
    "no common key": (
        Code.NO_COMMON_KEY,
        Severity.ERROR,
        a_silent_group(
            camera(key="c7"), an_input("/lidar", key="l7"), by_stamp=False, policy="equal_key", tolerance=None
        ),
        "no key came on all inputs while it was buffered; the newest are 'c7' of /camera, 'l7' of /lidar",
        "correct `key`, or write a larger `queue_size` if one input's keys come much later",
    ),
    "sets wider than slop": (
        Code.OVER_SLOP,
        Severity.ERROR,
        a_silent_group(figures=wide(*[61] * 5, 63)),
        "the nearest sets span 61 ms to 63 ms, over slop 20 ms",
        "write `slop: 65ms`, which would match 99 %",
    ),
    "sets wider than slop, of many widths": (
        Code.OVER_SLOP,
        Severity.ERROR,
        a_silent_group(figures=wide(*range(21, 121))),
        "the nearest sets span 21 ms to 115 ms, over slop 20 ms",
        "write `slop: 120ms`, which would match 99 %",
    ),
    "stamps that are never equal": (
        Code.OVER_SLOP,
        Severity.ERROR,
        a_silent_group(figures=wide(*[0.014] * 5), policy="exact_time", tolerance=Tolerance("slop", 0)),
        "no stamps are equal: the nearest sets span 14 us",
        "write `policy: approximate_time` and `slop: 14us`, which would match 99 %",
    ),
    "stamps that are equal mostly": (
        Code.OVER_SLOP,
        Severity.WARN,
        a_group(figures=wide(*[0] * 90, *[33] * 10), policy="exact_time", tolerance=Tolerance("slop", 0)),
        "10 % of the last 100 messages of /camera have no partner of an equal stamp",
        "look for messages that a driver leaves out or the network loses",
    ),
    "what is held is too old": (
        Code.OVER_SLOP,
        Severity.ERROR,
        a_silent_group(figures=wide(*[700] * 5), **HALF_A_SECOND),
        "the latest messages are 700 ms older than the trigger's, over max_age 500 ms",
        "write `max_age: 700ms`, which would match 99 %",
    ),
    "what is held is often too old": (
        Code.OVER_SLOP,
        Severity.WARN,
        a_group(figures=wide(*[100] * 5, *[700] * 5), **HALF_A_SECOND),
        "50 % of the last 10 messages of /lidar were farther from their partners than max_age 500 ms",
        "write `max_age: 700ms`, which would match 99 %",
    ),
    "sets wider than slop, whose messages were held up too": (
        Code.OVER_SLOP,
        Severity.ERROR,
        a_silent_group(camera(figures={"bursts": 1, "held": S}), LIDAR, figures=wide(*[61] * 5, 63)),
        "the nearest sets span 61 ms to 63 ms, over slop 20 ms",
        "write `slop: 65ms`, which would match 99 %",
    ),
    "most sets wider than slop, whose messages were held up too": (
        Code.OVER_SLOP,
        Severity.WARN,
        a_group(camera(figures={"bursts": 1, "held": S}), LIDAR, figures=wide(*[5] * 40, *[30] * 60)),
        "60 % of the last 100 messages of /camera were farther from their partners than slop 20 ms",
        "write `slop: 30ms`, which would match 99 %",
    ),
    "sets wider than slop, beside an optional input that was held up": (
        Code.OVER_SLOP,
        Severity.WARN,
        a_group(
            camera(required=False, figures={"bursts": 1, "held": S}),
            LIDAR,
            an_input("/imu"),
            figures=wide(*[5] * 90, *[30] * 10),
        ),
        "10 % of the last 100 messages of /lidar were farther from their partners than slop 20 ms",
        "write `slop: 30ms`, which would match 99 %",
    ),
    "some sets wider than slop": (
        Code.OVER_SLOP,
        Severity.WARN,
        a_group(figures=wide(*[5] * 90, *[30] * 10)),
        "10 % of the last 100 messages of /camera were farther from their partners than slop 20 ms",
        "write `slop: 30ms`, which would match 99 %",
    ),
    "a queue that is too short": (
        Code.SHORT_QUEUE,
        Severity.ERROR,
        a_silent_group(overflowing(40), LIDAR),
        "90 of the last 100 messages of /camera overflowed its queue of 10 before their partners came",
        "write `queue_size: 40`",
    ),
    "a queue that is too short at times": (
        Code.SHORT_QUEUE,
        Severity.WARN,
        a_group(overflowing(40), LIDAR, figures={"rate_hz": 9.0}),
        "90 of the last 100 messages of /camera overflowed its queue of 10 before their partners came",
        "write `queue_size: 40`",
    ),
    "sets without an optional input": (
        Code.WAITING_FOR_OPTIONAL,
        Severity.WARN,
        a_group(
            camera(required=False), LIDAR, an_input("/imu"), figures={"missing": (1.0, 0.0, 0.0)}, max_wait=100 * MS
        ),
        "100 % of the sets leave without /camera after waiting 100 ms for it",
        "see why /camera does not come in time, or write a larger `max_wait`",
    ),
    "an optional input whose stamps fit no set": (
        Code.WAITING_FOR_OPTIONAL,
        Severity.WARN,
        without_camera(delay=45 * MS, nearest=Distribution([40 * MS] * 99 + [63 * MS])),
        (
            "100 % of the sets leave without /camera after waiting 100 ms for it: the nearest sets with it span 40 ms"
            " to 40 ms, over slop 20 ms"
        ),
        "write `slop: 40ms`, which would take in 99 %",
    ),
    "an optional input of another clock": (
        Code.WAITING_FOR_OPTIONAL,
        Severity.WARN,
        without_camera(delay=37_205 * MS, nearest=Distribution([40 * MS] * 100)),
        (
            "100 % of the sets leave without /camera after waiting 100 ms for it: its stamps are 37.2 s behind those of"
            " the others"
        ),
        "synchronize their clocks, or write `offset: 37.2s` at /camera",
    ),
    "an optional input that comes late": (
        Code.WAITING_FOR_OPTIONAL,
        Severity.WARN,
        without_camera(delay=305 * MS, nearest=Distribution([3 * MS] * 100)),
        (
            "100 % of the sets leave without /camera after waiting 100 ms for it: it comes, 300 ms after the others,"
            " too late"
        ),
        "write a larger `max_wait`, or see what holds /camera up",
    ),
    "stamps that fell": (
        Code.TIME_JUMP,
        Severity.OK,
        a_group(camera(figures={"fell_by": 2900 * MS, "fell_at": NOW - 3 * S}), LIDAR),
        "stamps of /camera fell by 2.9 s 3 s ago: the group began anew",
        "a recording that is looped does this, or a reset clock",
    ),
    "messages that were held up": (
        Code.BURSTS,
        Severity.WARN,
        a_group(camera(figures={"bursts": 4, "held": 2900 * MS}), LIDAR),
        "4 times in the last 10 s messages of /camera came at once, up to 2.9 s late",
        (
            "where the network loses packets, reliable publishers send again at their next heartbeat only, each 3 s by"
            " default: run /usb_cam with configs/fast_heartbeats.xml, or best effort; else see whether /usb_cam sends"
            " in bursts, or a recorder stood still"
        ),
    ),
    "a message that DDS lost": (
        Code.MESSAGES_LOST,
        Severity.WARN,
        a_group(camera(lost=1), LIDAR),
        "DDS lost 1 message of /camera on the way here in the last 10 s",
        "look at the network and the load; what /usb_cam offers as reliable, `qos: auto` asks for again",
    ),
    "a relay that does not keep up": (
        Code.TOO_SLOW,
        Severity.WARN,
        a_group(waited=700 * MS),
        "messages lay here for 700 ms before the relay came to them",
        "give it more CPU, or spread the groups over several relays with --group",
    ),
    "an input that comes at a tenth of its rate": (
        Code.SLOWED,
        Severity.WARN,
        a_group(camera(figures={"pace_hz": 1.0, "slowed_from_hz": 10.0}), LIDAR),
        "/camera comes at 1 Hz, it came at 10 Hz",
        "look at /usb_cam: its settings, its load, and the network on the way",
    ),
    "disorder": (
        Code.OUT_OF_ORDER,
        Severity.WARN,
        a_group(camera(figures={"out_of_order": 2}), LIDAR),
        "2 of the last 100 messages of /camera came out of the order of their stamps",
        "see how /usb_cam stamps its messages",
    ),
    "disorder of two publishers": (
        Code.OUT_OF_ORDER,
        Severity.WARN,
        a_group(camera(figures={"out_of_order": 50}, publishers=(Endpoint("/a", IMAGE), Endpoint("/b", IMAGE))), LIDAR),
        "50 of the last 100 messages of /camera came out of the order of their stamps",
        "2 publish it, /a and /b: give each a topic of its own",
    ),
    "stamps that repeat": (
        Code.DUPLICATES,
        Severity.WARN,
        a_group(camera(figures={"duplicates": 50}), LIDAR),
        "50 of the last 100 messages of /camera repeat the stamp before them",
        "see how /usb_cam stamps its messages",
    ),
    "a clock that drifts": (
        Code.CLOCK_DRIFT,
        Severity.WARN,
        a_group(drifting(0.000_1), STEADY),
        "stamps of /camera lose 100 us a second against those of /lidar (100 ppm)",
        "synchronize their clocks with PTP or chrony, or have their drivers stamp with the host's time",
    ),
    "few sets": (
        Code.FEW_SETS,
        Severity.WARN,
        a_group(dropped(DropReason.LATE, 60), LIDAR, figures={"rate_hz": 4.0}),
        "4 of 10 possible sets a second leave; of /camera's last 100 messages 60 were dropped as late",
        "a policy or a `queue_size` that waits longer, such as `approximate_time` would give more",
    ),
    "few sets of a trigger, told by its own messages": (
        Code.FEW_SETS,
        Severity.WARN,
        a_group(
            an_input("/map", figures={"rate_hz": 1.0}),
            dropped(DropReason.EXPIRED, 60),
            figures={"rate_hz": 4.0},
            **AGES,
        ),
        "4 of 10 possible sets a second leave; of /camera's last 100 messages 60 were dropped as expired",
        "a larger `max_wait` would give more",
    ),
    "a subscriber that gets nothing": (
        Code.SUBSCRIBER_QOS,
        Severity.WARN,
        a_group(
            camera(subscribers=(Endpoint("/fusion", IMAGE, Mismatch("durability", "volatile", "transient_local")),)),
            LIDAR,
        ),
        "/fusion requests /front/camera with durability transient_local, the relay offers volatile, so it gets nothing",
        "have /fusion request volatile, or /camera's publisher offer transient_local",
    ),
    "what nothing explains": (
        Code.UNEXPLAINED,
        Severity.ERROR,
        a_silent_group(
            camera(figures={"dropped": {DropReason.TOO_FAR: 90, DropReason.LATE: 3}}),
            an_input("/lidar", figures={"fed": 0}),
        ),
        (
            "messages come on all inputs, but no set leaves: of /camera's last 100 messages 90 were dropped as too_far"
            " and 3 were dropped as late; of /lidar none came lately"
        ),
        "try a larger `queue_size`; `syncrelay doctor --live` looks at the graph and at the stamps",
    ),
    "a start": (
        Code.STARTING,
        Severity.OK,
        a_group(figures={"began": NOW - 3 * S, "last_set": None}),
        "no set yet, 3 s after the start",
        None,
    ),
    "health": (
        Code.HEALTHY,
        Severity.OK,
        a_group(),
        "10 of 10 possible sets a second, span 5 ms and latency 2 ms at the 95th percentile",
        None,
    ),
}

# The code that must not be found.
QUIETLY = {
    "no publisher in the first two seconds": (
        Code.NO_PUBLISHER,
        a_group(camera(publishers=()), LIDAR, figures={"began": NOW - 1900 * MS}),
    ),
    "another type is no QoS": (Code.INCOMPATIBLE_QOS, a_silent_group(camera(publishers=(STRANGER,)), LIDAR)),
    "what nobody publishes is not silent": (Code.SILENT, a_silent_group(camera(publishers=(), figures=QUIET), LIDAR)),
    "what does not fit is not silent": (Code.SILENT, a_silent_group(camera(publishers=(UNFIT,), figures=QUIET), LIDAR)),
    "silence while /clock stands": (Code.SILENT, a_silent_group(camera(figures=QUIET), LIDAR, clock_stopped=4 * S)),
    "a slow input between two messages": (
        Code.SILENT,
        a_group(camera(figures={"rate_hz": 0.1, "last_received": NOW - 9 * S}), LIDAR, figures={"best_hz": 0.1}),
    ),
    "a map that was sent once, long ago": (Code.SILENT, a_group(camera(figures=ONCE), LIDAR, **AGES)),
    "a state that is sent at odds": (
        Code.SILENT,
        a_group(camera(figures={**QUIET, "usual_hz": 3.0, "longest_pause": 4 * S}), LIDAR, **AGES),
    ),
    "another clock while sets leave": (Code.OTHER_CLOCK, a_group(camera(figures={"delay": 37_205 * MS}), LIDAR)),
    "another clock that its offset makes good": (
        Code.OTHER_CLOCK,
        a_silent_group(camera(offset=37_200 * MS, figures={"delay": 37_205 * MS}), LIDAR),
    ),
    "a second of delay": (Code.OTHER_CLOCK, a_silent_group(camera(figures={"delay": 1005 * MS}), LIDAR)),
    "what slop allows": (
        Code.OTHER_CLOCK,
        a_silent_group(camera(figures={"delay": 2 * S}), LIDAR, tolerance=Tolerance("slop", 3 * S)),
    ),
    "a latched message of an hour ago": (
        Code.OTHER_CLOCK,
        a_silent_group(camera(figures={**ONCE, "delay": 3600 * S}), LIDAR, **HALF_A_SECOND),
    ),
    "an unstamped input has no clock": (Code.OTHER_CLOCK, a_silent_group(camera(figures={"delay": None}), LIDAR)),
    "keys are not stamps": (Code.OTHER_CLOCK, a_silent_group(camera(figures={"delay": 37 * S}), LIDAR, by_stamp=False)),
    "nearest sets at slop": (Code.OVER_SLOP, a_silent_group(figures=wide(*[20] * 10))),
    "too few nearest sets to tell": (Code.OVER_SLOP, a_silent_group(figures=wide(*[30] * 4))),
    "nearest sets of before the silence": (
        Code.OVER_SLOP,
        a_silent_group(figures={"nearest": Distribution([30 * MS] * 50)}),
    ),
    "one in twenty over slop": (Code.OVER_SLOP, a_group(figures=wide(*[5] * 95, *[30] * 5))),
    "any distance is allowed": (Code.OVER_SLOP, a_silent_group(figures=wide(*[30] * 9), tolerance=None)),
    "stamps of another clock are not over slop": (
        Code.OVER_SLOP,
        a_silent_group(camera(figures={"delay": 37 * S}), LIDAR, figures=wide(*[30] * 9)),
    ),
    "an overflow of what nobody missed": (Code.SHORT_QUEUE, a_silent_group(overflowing(None), LIDAR)),
    "a queue that was long enough": (Code.SHORT_QUEUE, a_silent_group(overflowing(10), LIDAR)),
    "an overflow beside a stream of another clock": (
        Code.SHORT_QUEUE,
        a_silent_group(overflowing(40), an_input("/lidar", figures={"delay": 37 * S})),
    ),
    "an overflow while all sets leave": (Code.SHORT_QUEUE, a_group(overflowing(40), LIDAR)),
    "an overflow long ago": (
        Code.SHORT_QUEUE,
        a_silent_group(camera(counts=fed(needed_queue=40)), LIDAR),
    ),
    "a set in twenty without an optional input": (
        Code.WAITING_FOR_OPTIONAL,
        a_group(camera(required=False), LIDAR, figures={"missing": (0.05, 0.0)}),
    ),
    "stamps that fell half a minute ago": (
        Code.TIME_JUMP,
        a_group(camera(figures={"fell_by": 3 * S, "fell_at": NOW - 30 * S}), LIDAR),
    ),
    "messages that came at once because the relay stood still": (
        Code.BURSTS,
        a_group(camera(figures={"bursts": 1, "held": S}), LIDAR, waited=S),
    ),
    "stamps that are apart only because messages came at once": (
        Code.OVER_SLOP,
        a_group(camera(figures={"bursts": 1, "held": S}), LIDAR, figures=wide(3, 3, 3, 3, 300)),
    ),
    "messages that lay for less than half a second": (Code.TOO_SLOW, a_group(waited=499 * MS)),
    "one message in a hundred out of order": (Code.OUT_OF_ORDER, a_group(camera(figures={"out_of_order": 1}), LIDAR)),
    "disorder of stamps where keys are matched": (
        Code.OUT_OF_ORDER,
        a_group(camera(figures={"out_of_order": 50}), LIDAR, by_stamp=False),
    ),
    "one stamp in a hundred that repeats": (Code.DUPLICATES, a_group(camera(figures={"duplicates": 1}), LIDAR)),
    "a state that is sent again and again": (
        Code.DUPLICATES,
        a_group(camera(figures={"duplicates": 100}), LIDAR, **AGES),
    ),
    "four milliseconds of drift": (Code.CLOCK_DRIFT, a_group(drifting(0.000_066), STEADY)),
    "a drift of a few seconds": (Code.CLOCK_DRIFT, a_group(drifting(0.002, watched=19 * S), STEADY)),
    "a delay that changes with the load": (Code.CLOCK_DRIFT, a_group(drifting(0.000_2, bend=2.0 * MS), STEADY)),
    "two clocks that drift alike": (
        Code.CLOCK_DRIFT,
        a_group(drifting(0.5), an_input("/lidar", figures={"drift": Drift(0.5, 0.0, 60 * S)})),
    ),
    "four of five possible sets": (Code.FEW_SETS, a_group(figures={"rate_hz": 8.0})),
    "few sets in the first ten seconds": (Code.FEW_SETS, a_group(figures={"rate_hz": 4.0, "began": NOW - 9 * S})),
    "few sets in the window of a silence": (
        Code.FEW_SETS,
        a_group(figures={"rate_hz": 4.0, "resumed": NOW - 9 * S}),
    ),
    "no set yet where something is wrong": (
        Code.STARTING,
        a_group(camera(not_importable="no package"), LIDAR, figures={"began": NOW - 3 * S, "last_set": None}),
    ),
    "few sets because they are thinned": (Code.FEW_SETS, a_group(figures={"rate_hz": 2.0}, every=5)),
    "few sets at a greatest rate": (Code.FEW_SETS, a_group(figures={"rate_hz": 2.0}, least_period=500 * MS)),
    "few sets where few are possible": (Code.FEW_SETS, a_group(figures={"rate_hz": 0.1, "best_hz": 0.9})),
}


@pytest.mark.parametrize(("code", "severity", "facts", "text", "suggestion"), FOUND.values(), ids=FOUND)
def test_it_is_found_and_said(code, severity, facts, text, suggestion):
    found = next((finding for finding in find(facts) if finding.code is code), None)
    assert found is not None
    assert (found.severity, found.text, found.suggestion) == (severity, text, suggestion)


@pytest.mark.parametrize(("code", "facts"), QUIETLY.values(), ids=QUIETLY)
def test_it_is_not_found(code, facts):
    assert code not in {finding.code for finding in find(facts)}


def test_every_code_has_its_case():
    assert {case[0] for case in FOUND.values()} == set(Code)


@pytest.mark.parametrize("code", [code for code in Code if code is not Code.HEALTHY], ids=lambda code: code.value)
def test_a_healthy_group_has_no_other_finding(code):
    assert code not in {finding.code for finding in find(a_group())}


def test_findings_explain_a_silence_in_the_order_of_the_codes():
    ill = camera(
        publishers=(STRANGER, UNFIT),
        counts=fed(needed_queue=40),
        figures={"dropped": dict.fromkeys((DropReason.MALFORMED, DropReason.UNSTAMPED, DropReason.OVERFLOW), 90)},
    )
    codes = [finding.code for finding in find(a_silent_group(ill, an_input("/lidar", publishers=()), clock_stopped=S))]
    assert codes == sorted(codes, key=list(Code).index)
    assert len(set(codes)) >= 6


def test_a_required_input_is_blamed_before_an_optional_one():
    nobody = {"publishers": (), "figures": {"last_received": None}}
    group = a_silent_group(camera(required=False, **nobody), an_input("/lidar", **nobody))
    first, second = find(group)[:2]
    assert (first.input, first.severity) == (1, Severity.ERROR)
    assert (second.input, second.severity) == (0, Severity.WARN)


def test_an_explanation_is_the_first_of_the_worst():
    ok, warn, error, worse = (
        Finding(Code.TIME_JUMP, Severity.OK, "a"),
        Finding(Code.DUPLICATES, Severity.WARN, "b"),
        Finding(Code.OVER_SLOP, Severity.ERROR, "c"),
        Finding(Code.SHORT_QUEUE, Severity.ERROR, "d"),
    )
    assert explanation((ok, warn, error, worse)) is error
    assert explanation((ok, warn)) is warn


def test_an_explanation_of_nothing_bad_is_the_last_word():
    assert explanation(find(FOUND["stamps that fell"][2])).code is Code.HEALTHY


def test_a_group_is_silent_after_five_seconds_or_three_sets():
    assert not a_group(figures={"last_set": NOW - 4999 * MS}).is_silent
    assert a_group(figures={"last_set": NOW - 5 * S}).is_silent
    assert not a_group(figures={"last_set": NOW - 29 * S, "best_hz": 0.1}).is_silent
    assert a_group(figures={"last_set": NOW - 30 * S, "best_hz": 0.1}).is_silent
    assert not a_group(figures={"last_set": NOW - 29 * S}, every=100).is_silent
    assert a_group(figures={"last_set": None, "began": BEGAN}).is_silent
