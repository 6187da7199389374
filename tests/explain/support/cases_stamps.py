"""What stamps tell: facts that come to a finding, and the nearest that do not."""

from syncrelay.config import Distance
from syncrelay.explain import ClockState, Code, Distribution, Endpoint, Severity, Step, Tolerance
from syncrelay.explain.clocks import Drift
from syncrelay.sync.messages import DropReason
from tests.explain.support.cases import (
    AGES,
    HALF_A_SECOND,
    LIDAR,
    ONCE,
    STEADY,
    camera,
    drifting,
    dropped,
    stamped,
    wide,
)
from tests.explain.support.groups import IMAGE, MS, NOW, S, a_group, a_silent_group, an_input

AT_TICKS = {
    "policy": "latest_time",
    "ticks_hz": 30.0,
    "tolerance": Tolerance("max_age", 200 * MS),
    "distance": Distance.AGE,
    "repeats": True,
}

TWO = Endpoint("/a", IMAGE), Endpoint("/b", IMAGE)

SWINGING = {"swings": 2, "swung_by": 3 * S}

STEPPED = {"stepped": Step(NOW - 12 * S, -2 * S)}

# Made-up facts have no messages to try values on: see test_suggestions.py for those.
CHECK_STAMPS = "check how these topics are stamped, and whether messages are missing"

# Code, severity, facts, sentence, suggestion.
FOUND = {
    "messages that are cut short": (
        Code.MALFORMED,
        Severity.ERROR,
        a_silent_group(dropped(DropReason.MALFORMED, 100), LIDAR),
        "all 100 messages of /camera are cut short, or not of its type",
        f"check that /usb_cam uses the same version of {IMAGE} as is installed here",
    ),
    "a few messages that are cut short explain no silence": (
        Code.MALFORMED,
        Severity.WARN,
        a_silent_group(dropped(DropReason.MALFORMED, 3), LIDAR),
        "3 of the last 100 messages of /camera are cut short, or not of its type",
        f"check that /usb_cam uses the same version of {IMAGE} as is installed here",
    ),
    "messages that are cut short, or whose key stands too far behind": (
        Code.MALFORMED,
        Severity.ERROR,
        a_silent_group(dropped(DropReason.MALFORMED, 100), LIDAR, by_stamp=False, policy="equal_key", tolerance=None),
        "all 100 messages of /camera are cut short, not of its type, or have too many values before the key",
        f"check that /usb_cam uses the same version of {IMAGE} as is installed here",
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
    "stamps that count from boot": (
        Code.OTHER_CLOCK,
        Severity.ERROR,
        a_silent_group(camera(figures={"delay": NOW - 5000 * S, "stamps": (5000 * S,)}), LIDAR),
        (
            "stamps of /camera are 54 years behind those of /lidar: they count from boot or the start of a simulation,"
            " not from 1970"
        ),
        "have /usb_cam stamp with the host's time, or write `stamp: receive` at /camera",
    ),
    "stamps of GPS time since 1980": (
        Code.OTHER_CLOCK,
        Severity.ERROR,
        a_silent_group(camera(figures={"delay": 315_964_782 * S}), LIDAR),
        "stamps of /camera are 10 years behind those of /lidar: they look like GPS time, which counts from 1980",
        "have /usb_cam stamp with the host's time, or write `stamp: receive` at /camera",
    ),
    "stamps of TAI": (
        Code.OTHER_CLOCK,
        Severity.ERROR,
        a_silent_group(camera(figures={"delay": -37 * S}), LIDAR),
        (
            "stamps of /camera are 37 s ahead of those of /lidar: they look like TAI, the time of PTP clocks, which is"
            " 37 s ahead of UTC"
        ),
        "have /usb_cam stamp with the host's time, or write `offset: -37s` at /camera",
    ),
    "stamps of GPS time since 1970": (
        Code.OTHER_CLOCK,
        Severity.ERROR,
        a_silent_group(camera(figures={"delay": -18 * S}), LIDAR),
        ("stamps of /camera are 18 s ahead of those of /lidar: they look like GPS time, which is 18 s ahead of UTC"),
        "have /usb_cam stamp with the host's time, or write `offset: -18s` at /camera",
    ),
    "stamps of local time": (
        Code.OTHER_CLOCK,
        Severity.ERROR,
        a_silent_group(camera(figures={"delay": 7200 * S}), LIDAR),
        "stamps of /camera are 2 h behind those of /lidar: they look like local time, not UTC",
        "have /usb_cam stamp with the host's time, or write `offset: 7200s` at /camera",
    ),
    **{
        f"stamps that are off the clock that triggers: {name}": (
            Code.OTHER_CLOCK,
            Severity.ERROR,
            a_silent_group(
                *(an_input(each, figures={"delay": None, "delays": (40 * S,) * 20}) for each in ("/camera", "/lidar")),
                **AT_TICKS,
                **facts,
            ),
            f"stamps of all inputs are 40 s behind {name}, which triggers the sets",
            remedy,
        )
        for name, facts, remedy in (
            (
                "this machine's clock",
                {},
                (
                    "with a simulation or a recording, write `node: {use_sim_time: true}` and play it with --clock;"
                    " else synchronize the clocks of the machines"
                ),
            ),
            (
                "the recorder's clock",
                {"is_recorded": True},
                (
                    "record what a simulation publishes with `ros2 bag record --use-sim-time`, or let an input be the"
                    " `trigger`"
                ),
            ),
            (
                "/clock",
                {"clock": ClockState(received=True)},
                "check whether what publishes these topics uses simulated time as well",
            ),
        )
    },
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
    "no common key": (
        Code.NO_COMMON_KEY,
        Severity.ERROR,
        a_silent_group(
            camera(key="c7"), an_input("/lidar", key="l7"), by_stamp=False, policy="equal_key", tolerance=None
        ),
        "no key arrived on all inputs while it was buffered; the newest are 'c7' of /camera, 'l7' of /lidar",
        "correct `key`, or write a larger `queue_size` if one input's keys arrive much later",
    ),
    "messages that are too old at ticks": (
        Code.OVER_SLOP,
        Severity.ERROR,
        a_silent_group(camera(figures={"delay": None, "delays": (305 * MS,) * 20, "pace_hz": 10.0}), LIDAR, **AT_TICKS),
        "at a tick, the latest message of /camera is 305 ms to 405 ms old, max_age is 200 ms",
        "write `max_age: 550ms`, or `max_wait: 400ms`, which delays every set by that",
    ),
    "sets wider than slop": (
        Code.OVER_SLOP,
        Severity.ERROR,
        a_silent_group(figures=wide(*[61] * 5, 63)),
        "the nearest sets span 61 ms to 63 ms, over slop 20 ms",
        CHECK_STAMPS,
    ),
    "sets wider than slop, of many widths": (
        Code.OVER_SLOP,
        Severity.ERROR,
        a_silent_group(figures=wide(*range(21, 121))),
        "the nearest sets span 21 ms to 115 ms, over slop 20 ms",
        CHECK_STAMPS,
    ),
    "stamps that are never equal": (
        Code.OVER_SLOP,
        Severity.ERROR,
        a_silent_group(
            figures=wide(*[0.014] * 5), policy="exact_time", tolerance=Tolerance("slop", 0, "approximate_time")
        ),
        "no stamps are equal: the nearest sets span 14 us",
        CHECK_STAMPS,
    ),
    "stamps that are equal mostly": (
        Code.OVER_SLOP,
        Severity.WARN,
        a_group(
            figures=wide(*[0] * 90, *[33] * 10), policy="exact_time", tolerance=Tolerance("slop", 0, "approximate_time")
        ),
        "10 % of the last 100 messages of /camera have no partner with an equal stamp",
        CHECK_STAMPS,
    ),
    "what is held is too old": (
        Code.OVER_SLOP,
        Severity.ERROR,
        a_silent_group(figures=wide(*[700] * 5), **HALF_A_SECOND),
        "the latest messages are 700 ms older than the trigger's, over max_age 500 ms",
        CHECK_STAMPS,
    ),
    "what is held is often too old": (
        Code.OVER_SLOP,
        Severity.WARN,
        a_group(figures=wide(*[100] * 5, *[700] * 5), **HALF_A_SECOND),
        "50 % of the last 10 messages of /lidar were farther from their partners than max_age 500 ms",
        CHECK_STAMPS,
    ),
    "sets wider than slop, whose messages were held up too": (
        Code.OVER_SLOP,
        Severity.ERROR,
        a_silent_group(camera(figures={"bursts": 1, "held": S}), LIDAR, figures=wide(*[61] * 5, 63)),
        "the nearest sets span 61 ms to 63 ms, over slop 20 ms",
        CHECK_STAMPS,
    ),
    "most sets wider than slop, whose messages were held up too": (
        Code.OVER_SLOP,
        Severity.WARN,
        a_group(camera(figures={"bursts": 1, "held": S}), LIDAR, figures=wide(*[5] * 40, *[30] * 60)),
        "60 % of the last 100 messages of /camera were farther from their partners than slop 20 ms",
        CHECK_STAMPS,
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
        CHECK_STAMPS,
    ),
    "some sets wider than slop": (
        Code.OVER_SLOP,
        Severity.WARN,
        a_group(figures=wide(*[5] * 90, *[30] * 10)),
        "10 % of the last 100 messages of /camera were farther from their partners than slop 20 ms",
        CHECK_STAMPS,
    ),
    "stamps that fell": (
        Code.TIME_JUMP,
        Severity.OK,
        a_group(camera(figures={"fell_by": 2900 * MS, "fell_at": NOW - 3 * S}), LIDAR),
        "timestamps of /camera jumped back 2.9 s, 3 s ago; matching restarted",
        "a looped recording does this, or a clock that was reset",
    ),
    "disorder": (
        Code.OUT_OF_ORDER,
        Severity.WARN,
        a_group(camera(figures={"out_of_order": 2}), LIDAR),
        "2 of the last 100 messages of /camera arrived out of stamp order",
        "check how /usb_cam stamps and sends",
    ),
    "disorder of two publishers": (
        Code.SEVERAL_PUBLISHERS,
        Severity.WARN,
        a_group(camera(figures={"out_of_order": 50}, publishers=TWO), LIDAR),
        "/a and /b both publish /camera: 50 of the last 100 messages repeat a stamp or arrived out of stamp order",
        "give each publisher its own topic, or stop all but one",
    ),
    "two publishers by two clocks": (
        Code.SEVERAL_PUBLISHERS,
        Severity.ERROR,
        a_silent_group(camera(figures=SWINGING, publishers=TWO), LIDAR),
        "/a and /b both publish /camera: their stamps are 3 s apart",
        "give each publisher its own topic, or stop all but one",
    ),
    "a node that publishes twice": (
        Code.SEVERAL_PUBLISHERS,
        Severity.WARN,
        a_group(camera(figures=SWINGING, publishers=(Endpoint("/a", IMAGE),) * 2), LIDAR),
        "/a and /a both publish /camera: their stamps are 3 s apart",
        "give each publisher its own topic, or stop all but one",
    ),
    "three publishers": (
        Code.SEVERAL_PUBLISHERS,
        Severity.WARN,
        a_group(camera(figures=SWINGING, publishers=(*TWO, Endpoint("/c", IMAGE))), LIDAR),
        "/a, /b and /c all publish /camera: their stamps are 3 s apart",
        "give each publisher its own topic, or stop all but one",
    ),
    "one publisher of two clocks": (
        Code.TIME_JUMP,
        Severity.WARN,
        a_group(camera(figures=SWINGING), LIDAR),
        "timestamps of /camera jump back and forth by 3 s",
        "check whether /usb_cam stamps by two clocks, or two nodes publish /camera",
    ),
    "one clock that stepped": (
        Code.CLOCK_STEP,
        Severity.ERROR,
        a_silent_group(camera(figures={"stepped": Step(NOW - 12 * S, 2 * S)}), LIDAR),
        "stamps of /camera jumped forward by 2 s, 12 s ago; those of the other inputs did not",
        "check what set the clock of /usb_cam; NTP and chrony can be told to slew it instead",
    ),
    "one clock that stepped while the others sent nothing": (
        Code.CLOCK_STEP,
        Severity.ERROR,
        a_silent_group(
            camera(figures={"stepped": Step(NOW - 12 * S, 2 * S)}),
            an_input("/lidar", figures={"last_received": NOW - 20 * S}),
        ),
        "stamps of /camera jumped forward by 2 s, 12 s ago",
        "check what set the clock of /usb_cam; NTP and chrony can be told to slew it instead",
    ),
    "the clock of all inputs that stepped": (
        Code.CLOCK_STEP,
        Severity.WARN,
        a_group(camera(figures=STEPPED), an_input("/lidar", figures=STEPPED)),
        "stamps of all inputs jumped back by 2 s against this machine's clock, 12 s ago",
        "check what set the clock on the machine that stamps them; NTP and chrony can be told to slew it instead",
    ),
    "this machine's clock that was set": (
        Code.CLOCK_STEP,
        Severity.WARN,
        a_group(clock_set=Step(NOW - 12 * S, -2 * S)),
        "this machine's clock was set back by 2 s, 12 s ago",
        "check what set the clock here; NTP and chrony can be told to slew it instead",
    ),
    "stamps that repeat": (
        Code.DUPLICATES,
        Severity.WARN,
        a_group(camera(figures={"duplicates": 50}), LIDAR),
        "50 of the last 100 messages of /camera repeat the stamp before them",
        "check how /usb_cam stamps its messages",
    ),
    "a clock that drifts fast is seen soon": (
        Code.CLOCK_DRIFT,
        Severity.ERROR,
        a_silent_group(drifting(0.01, watched=6 * S), STEADY, figures=wide(*[30] * 9)),
        "stamps of /camera lose 10 ms a second against those of /lidar (10000 ppm)",
        "synchronize their clocks with PTP or chrony, or have their drivers stamp with the host's time",
    ),
    "two clocks that drift apart": (
        Code.CLOCK_DRIFT,
        Severity.WARN,
        a_group(drifting(0.000_1), an_input("/lidar", figures={"drift": Drift(-0.000_1, 0.0, 60 * S)})),
        "stamps of /camera and /lidar drift apart by 200 us a second (200 ppm)",
        "synchronize their clocks with PTP or chrony, or have their drivers stamp with the host's time",
    ),
    "one clock of three that drifts": (
        Code.CLOCK_DRIFT,
        Severity.WARN,
        a_group(STEADY, drifting(-0.000_1), an_input("/imu", figures={"drift": Drift(0.000_01, 0.0, 60 * S)})),
        "stamps of /camera gain 100 us a second against those of the other inputs (100 ppm)",
        "synchronize their clocks with PTP or chrony, or have their drivers stamp with the host's time",
    ),
    "a clock that drifts": (
        Code.CLOCK_DRIFT,
        Severity.WARN,
        a_group(drifting(0.000_1), STEADY),
        "stamps of /camera lose 100 us a second against those of /lidar (100 ppm)",
        "synchronize their clocks with PTP or chrony, or have their drivers stamp with the host's time",
    ),
    "stamps that lie a constant distance off, nearer to the next message's": (
        Code.CONSTANT_OFFSET,
        Severity.WARN,
        a_group(camera(figures=stamped(-80 * MS, delay=85 * MS)), an_input("/lidar", figures=stamped(0))),
        (
            "stamps of /camera are always 80 ms behind those of /lidar received at the same time: sets may hold"
            " messages of different moments"
        ),
        "check how /usb_cam stamps; if both are measured at the same time, write `offset: 80ms` at /camera",
    ),
}

# The code that must not be found, facts.
QUIETLY = {
    "a constant distance that its delay explains": (
        Code.CONSTANT_OFFSET,
        a_group(camera(figures=stamped(0, delay=80 * MS)), an_input("/lidar", figures=stamped(0))),
    ),
    "a constant distance of inputs of two rates": (
        Code.CONSTANT_OFFSET,
        a_group(camera(figures=stamped(-80 * MS, delay=85 * MS, pace_hz=12)), an_input("/lidar", figures=stamped(0))),
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
    "stamps that fell half a minute ago": (
        Code.TIME_JUMP,
        a_group(camera(figures={"fell_by": 3 * S, "fell_at": NOW - 30 * S}), LIDAR),
    ),
    "stamps that are apart only because messages came at once": (
        Code.OVER_SLOP,
        a_group(camera(figures={"bursts": 1, "held": S}), LIDAR, figures=wide(3, 3, 3, 3, 300)),
    ),
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
    "a drift of a few seconds": (Code.CLOCK_DRIFT, a_group(drifting(0.001, watched=19 * S), STEADY)),
    "a delay that changes with the load": (Code.CLOCK_DRIFT, a_group(drifting(0.000_2, bend=2.0 * MS), STEADY)),
    "two clocks that drift alike": (
        Code.CLOCK_DRIFT,
        a_group(drifting(0.5), an_input("/lidar", figures={"drift": Drift(0.5, 0.0, 60 * S)})),
    ),
}
