"""What the flow tells: facts that come to a finding, and the nearest that do not."""

from syncrelay.explain import Code, Distribution, Pause, Severity, Share, Standing, Standstill
from syncrelay.sync.messages import DropReason
from tests.explain.support.cases import AGES, LIDAR, camera, dropped, fed, overflowing, without_camera
from tests.explain.support.groups import MS, NOW, S, a_group, a_silent_group, an_input

HELD_UP = {"bursts": 1, "held": 2 * S, "held_up": [(NOW - 4 * S, NOW - 2 * S)]}
FEW = {"standing": Standing.FEW}
_LEFT = "possible sets left in the last 10 s"


def held_up(begin, end):
    return camera(figures={"bursts": 1, "held": end - begin, "held_up": [(begin, end)]})


# Code, severity, facts, sentence, suggestion.
FOUND = {
    "a group that somebody paused": (
        Code.PAUSED,
        Severity.WARN,
        a_silent_group(camera(), LIDAR, pause=Pause(NOW - 12 * S, "/syncrelay/resume")),
        "paused for 12 s: no set leaves",
        "`ros2 service call /syncrelay/resume std_srvs/srv/Trigger` ends the pause",
    ),
    "a queue that is too short": (
        Code.SHORT_QUEUE,
        Severity.ERROR,
        a_silent_group(overflowing(40), LIDAR),
        "90 of the last 100 messages of /camera overflowed its queue of 10 before their partners came",
        None,
    ),
    "a queue that is too short at times": (
        Code.SHORT_QUEUE,
        Severity.WARN,
        a_group(overflowing(40), LIDAR, figures={"rate_hz": 9.0}),
        "90 of the last 100 messages of /camera overflowed its queue of 10 before their partners came",
        None,
    ),
    "sets without an optional input": (
        Code.WAITING_FOR_OPTIONAL,
        Severity.WARN,
        a_group(
            camera(required=False), LIDAR, an_input("/imu"), figures={"missing": (1.0, 0.0, 0.0)}, max_wait=100 * MS
        ),
        "100 % of the sets leave without /camera after waiting 100 ms for it",
        "check whether messages of /camera arrive late or are lost",
    ),
    "an optional input whose stamps fit no set": (
        Code.WAITING_FOR_OPTIONAL,
        Severity.WARN,
        without_camera(delay=45 * MS, nearest=Distribution([40 * MS] * 99 + [63 * MS])),
        (
            "100 % of the sets leave without /camera after waiting 100 ms for it: the nearest sets with it span 40 ms"
            " to 40 ms, over slop 20 ms"
        ),
        "check how /usb_cam stamps its messages",
    ),
    "an optional input of another clock": (
        Code.WAITING_FOR_OPTIONAL,
        Severity.WARN,
        without_camera(delay=37_205 * MS, nearest=Distribution([40 * MS] * 100)),
        (
            "100 % of the sets leave without /camera after waiting 100 ms for it: its stamps are 37.2 s behind those of"
            " the others"
        ),
        "synchronize their clocks",
    ),
    "an optional input that comes late": (
        Code.WAITING_FOR_OPTIONAL,
        Severity.WARN,
        without_camera(delay=305 * MS, nearest=Distribution([3 * MS] * 100)),
        (
            "100 % of the sets leave without /camera after waiting 100 ms for it: it arrives 300 ms after the others,"
            " too late"
        ),
        "check what delays /camera",
    ),
    "an optional input that comes late, and seldom": (
        Code.WAITING_FOR_OPTIONAL,
        Severity.WARN,
        without_camera(delay=305 * MS, nearest=Distribution([3 * MS] * 100), rate_hz=2.0, usual_hz=2.0, pace_hz=2.0),
        (
            "100 % of the sets leave without /camera after waiting 100 ms for it, 80 % because it comes at 2 Hz only:"
            " it arrives 300 ms after the others, too late"
        ),
        "check what delays /camera",
    ),
    "an optional input that went away": (
        Code.WAITING_FOR_OPTIONAL,
        Severity.WARN,
        without_camera(delay=305 * MS, nearest=Distribution([3 * MS] * 100), last_received=NOW - 4 * S),
        "100 % of the sets leave without /camera after waiting 100 ms for it: it has been silent for 4 s",
        "check /usb_cam",
    ),
    "an optional input that never came": (
        Code.WAITING_FOR_OPTIONAL,
        Severity.OK,
        without_camera(last_received=None),
        "100 % of the sets leave without /camera after waiting 100 ms for it: no message of it has arrived",
        "check /usb_cam",
    ),
    "an optional input that comes in time and is missing all the same": (
        Code.WAITING_FOR_OPTIONAL,
        Severity.WARN,
        without_camera(delay=104 * MS, nearest=Distribution([3 * MS] * 100)),
        "100 % of the sets leave without /camera after waiting 100 ms for it",
        "check whether messages of /camera arrive late or are lost",
    ),
    "messages that were held up": (
        Code.BURSTS,
        Severity.WARN,
        a_group(camera(figures={"bursts": 4, "held": 2900 * MS}), LIDAR),
        "messages of /camera arrived in a burst 4 times in the last 10 s, up to 2.9 s late",
        (
            "check whether /usb_cam sends in bursts; if it runs on another machine, check the network: after a loss,"
            " reliable publishers send again only every 3 s by default; configs/fast_heartbeats.xml makes them faster"
        ),
    ),
    "messages of all inputs that were held up together": (
        Code.BURSTS,
        Severity.WARN,
        a_group(held_up(NOW - 4 * S, NOW - 2 * S), an_input("/lidar", figures=HELD_UP)),
        "messages of all inputs arrived in a burst once in the last 10 s, up to 2 s late",
        "check whether this machine, a player or what connects them stood still",
    ),
    "messages of two inputs of three that were held up together": (
        Code.BURSTS,
        Severity.WARN,
        a_group(held_up(NOW - 3 * S, NOW - S), an_input("/lidar", figures=HELD_UP), an_input("/imu")),
        "messages of /camera and /lidar arrived in a burst once in the last 10 s, up to 2 s late",
        "check whether this machine, a player or what connects them stood still",
    ),
    "messages that were recorded in a burst": (
        Code.BURSTS,
        Severity.WARN,
        a_group(held_up(NOW - 3 * S, NOW - S), LIDAR, is_recorded=True),
        "messages of /camera arrived in a burst once in the last 10 s, up to 2 s late",
        "check whether /usb_cam sent in bursts, or the recorder received it late",
    ),
    "a standstill in which messages were missed": (
        Code.TOO_SLOW,
        Severity.WARN,
        a_group(
            camera(figures={"longest_pause": 3 * S, "last_received": NOW - S}),
            LIDAR,
            standstills=(Standstill(NOW - S, 3 * S),),
        ),
        "the relay stood still for 3 s",
        (
            "check whether other processes leave it enough CPU; if they do, spread the groups over several relays with"
            " --group"
        ),
    ),
    "a message that DDS lost": (
        Code.MESSAGES_LOST,
        Severity.WARN,
        a_group(camera(lost=1), LIDAR),
        "DDS lost 1 message of /camera on the way here in the last 10 s",
        "check the network and the CPU load; if /usb_cam is reliable, `qos: auto` makes it resend them",
    ),
    "a relay that does not keep up": (
        Code.TOO_SLOW,
        Severity.WARN,
        a_group(waited=700 * MS),
        "messages waited up to 700 ms for the relay",
        (
            "check whether other processes leave it enough CPU; if they do, spread the groups over several relays with"
            " --group"
        ),
    ),
    "messages that came at once when a standstill was over": (
        Code.TOO_SLOW,
        Severity.WARN,
        a_group(
            # The last second of them by the network, which sends again what it could not deliver.
            camera(figures={"bursts": 1, "held": 4 * S, "held_up": [(NOW - 8 * S, NOW - 4 * S)]}),
            LIDAR,
            standstills=(Standstill(NOW - 5 * S, 2 * S),),
        ),
        "messages waited up to 2 s for the relay",
        (
            "check whether other processes leave it enough CPU; if they do, spread the groups over several relays with"
            " --group"
        ),
    ),
    "an input that comes at a tenth of its rate": (
        Code.SLOWED,
        Severity.WARN,
        a_group(camera(figures={"pace_hz": 1.0, "slowed_from_hz": 10.0}), LIDAR),
        "/camera has slowed from 10 Hz to 1 Hz",
        "check /usb_cam: its settings, its load, and the network to it",
    ),
    "few sets": (
        Code.FEW_SETS,
        Severity.WARN,
        a_group(dropped(DropReason.LATE, 60), LIDAR, figures={"share": Share(40, 100, 10 * S, 0)}, **FEW),
        "40 of 100 possible sets left in the last 10 s; of the last 100 messages of /camera, 60 were dropped as late",
        None,
    ),
    "few sets since a silence": (
        Code.FEW_SETS,
        Severity.ERROR,
        a_group(
            dropped(DropReason.LATE, 60),
            LIDAR,
            figures={"share": Share(1, 100, 10 * S, 0)},
            standing=Standing.NONE,
        ),
        "1 of 100 possible sets left in the last 10 s; of the last 100 messages of /camera, 60 were dropped as late",
        None,
    ),
    "few sets of an input that pauses": (
        Code.FEW_SETS,
        Severity.WARN,
        a_group(camera(), LIDAR, figures={"share": Share(60, 100, 10 * S, 0, absent=40)}, **FEW),
        f"60 of 100 {_LEFT}; 40 messages of /camera did not come: it pauses, or they are lost",
        "check /usb_cam, and the network to it",
    ),
    "few sets of a trigger, told by its own messages": (
        Code.FEW_SETS,
        Severity.WARN,
        a_group(
            an_input("/map", figures={"rate_hz": 1.0}),
            dropped(DropReason.EXPIRED, 60),
            figures={"share": Share(40, 100, 10 * S, 1)},
            **FEW,
            **AGES,
        ),
        f"40 of 100 {_LEFT}; of the last 100 messages of /camera, 60 were dropped as expired",
        None,
    ),
    "what nothing explains": (
        Code.UNEXPLAINED,
        Severity.ERROR,
        a_silent_group(
            camera(figures={"dropped": {DropReason.TOO_FAR: 90, DropReason.LATE: 3}}),
            an_input("/lidar", figures={"fed": 0}),
        ),
        (
            "messages arrive on all inputs, but no set leaves: of the last 100 messages of /camera, 90 were dropped as"
            " too_far and 3 were dropped as late; no messages of /lidar arrived recently"
        ),
        "run `syncrelay doctor --config FILE --live`, which checks the graph and the stamps",
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

# The code that must not be found, facts.
QUIETLY = {
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
    "an optional input that has been back for three times as many sets as it missed": (
        Code.WAITING_FOR_OPTIONAL,
        a_group(camera(required=False), LIDAR, figures={"missing": (0.5, 0.0), "sets_since_without": (6, 100)}),
    ),
    "messages that came at once because the relay stood still": (
        Code.BURSTS,
        a_group(camera(figures={"bursts": 1, "held": S}), LIDAR, waited=S),
    ),
    "a standstill in which no message came": (Code.TOO_SLOW, a_group(standstills=(Standstill(NOW - S, 3 * S),))),
    "messages that came at once at another time than that of a standstill": (
        Code.TOO_SLOW,
        a_group(
            camera(figures={"bursts": 1, "held": S, "held_up": [(NOW - 5 * S, NOW - 4 * S)]}),
            LIDAR,
            standstills=(Standstill(NOW - 5 * S, 2 * S),),
        ),
    ),
    "messages that lay for less than half a second": (Code.TOO_SLOW, a_group(waited=499 * MS)),
    "enough sets": (Code.FEW_SETS, a_group(figures={"share": Share(80, 100, 10 * S)})),
    "few sets while none leaves": (
        Code.FEW_SETS,
        a_silent_group(figures={"share": Share(40, 100, 10 * S)}, standing=Standing.NONE),
    ),
    "few sets of too few to tell": (Code.FEW_SETS, a_group(figures={"share": Share(1, 9, 10 * S)}, **FEW)),
    "no set yet where something is wrong": (
        Code.STARTING,
        a_group(camera(not_importable="no package"), LIDAR, figures={"began": NOW - 3 * S, "last_set": None}),
    ),
}
