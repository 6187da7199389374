"""What stamps tell: facts that come to a finding, and the nearest that do not."""

from cases import AGES, HALF_A_SECOND, LIDAR, ONCE, STEADY, camera, drifting, dropped, fed, wide
from groups import IMAGE, MS, NOW, S, a_group, a_silent_group, an_input

from syncrelay.explain import Code, Distribution, Endpoint, Severity, Tolerance
from syncrelay.explain.drift import Drift
from syncrelay.sync.messages import DropReason

# Code, severity, facts, sentence, suggestion.
FOUND = {
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
        a_silent_group(
            figures=wide(*[0.014] * 5), policy="exact_time", tolerance=Tolerance("slop", 0, "approximate_time")
        ),
        "no stamps are equal: the nearest sets span 14 us",
        "write `policy: approximate_time` and `slop: 14us`, which would match 99 %",
    ),
    "stamps that are equal mostly": (
        Code.OVER_SLOP,
        Severity.WARN,
        a_group(
            figures=wide(*[0] * 90, *[33] * 10), policy="exact_time", tolerance=Tolerance("slop", 0, "approximate_time")
        ),
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
    "stamps that fell": (
        Code.TIME_JUMP,
        Severity.OK,
        a_group(camera(figures={"fell_by": 2900 * MS, "fell_at": NOW - 3 * S}), LIDAR),
        "stamps of /camera fell by 2.9 s 3 s ago: the group began anew",
        "a recording that is looped does this, or a reset clock",
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
}

# The code that must not be found, facts.
QUIETLY = {
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
    "a drift of a few seconds": (Code.CLOCK_DRIFT, a_group(drifting(0.002, watched=19 * S), STEADY)),
    "a delay that changes with the load": (Code.CLOCK_DRIFT, a_group(drifting(0.000_2, bend=2.0 * MS), STEADY)),
    "two clocks that drift alike": (
        Code.CLOCK_DRIFT,
        a_group(drifting(0.5), an_input("/lidar", figures={"drift": Drift(0.5, 0.0, 60 * S)})),
    ),
}
