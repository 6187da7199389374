"""What stamps tell: facts that come to a finding, and the nearest that do not."""

from syncrelay.config import Distance
from syncrelay.explain import ClockState, Code, Distribution, Endpoint, Step, Tolerance
from syncrelay.explain.clocks import Drift
from syncrelay.explain.epochs import Reading
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

HOUR = 3600 * S

STEPPED = {"stepped": Step(NOW - 12 * S, -2 * S)}

# What is said of each stands in tests/explain/findings.txt.
FOUND = {
    "messages that are cut short": a_silent_group(dropped(DropReason.MALFORMED, 100), LIDAR),
    "a few messages that are cut short explain no silence": a_silent_group(dropped(DropReason.MALFORMED, 3), LIDAR),
    "messages that are cut short, or whose key stands too far behind": a_silent_group(
        dropped(DropReason.MALFORMED, 100), LIDAR, by_stamp=False, policy="equal_key", tolerance=None
    ),
    "stamps of 0": a_silent_group(dropped(DropReason.UNSTAMPED, 100, delay=None), LIDAR),
    "stamps of another clock": a_silent_group(camera(figures={"delay": 37_205 * MS}), LIDAR),
    "stamps ahead of their time while sets leave": a_group(
        camera(figures={"delay": -997 * MS, "received": tuple(NOW - n * S for n in range(9, -1, -1))}), LIDAR
    ),
    "stamps of two hosts of four inputs": a_silent_group(
        *(an_input(f"/{name}", figures={"delay": -2 * HOUR}) for name in ("camera", "imu")), LIDAR, an_input("/gps")
    ),
    "stamps of another clock than the simulated one": a_silent_group(
        camera(figures={"delay": -2 * HOUR}), LIDAR, clock=ClockState(received=True)
    ),
    "stamps that run faster than simulated time": a_silent_group(
        camera(figures={"stamps": (1, 2), "reading": Reading("run at 2 times the speed of", 2.0)}),
        LIDAR,
        clock=ClockState(received=True),
    ),
    "stamps that are recorded to run slower": a_silent_group(
        camera(figures={"stamps": (1, 2), "reading": Reading("run at 0.5 times the speed of", 0.5)}),
        LIDAR,
        is_recorded=True,
    ),
    "stamps that count from boot": a_silent_group(
        camera(figures={"delay": NOW - 5000 * S, "stamps": (5000 * S,)}), LIDAR
    ),
    "stamps of GPS time since 1980": a_silent_group(camera(figures={"delay": 315_964_782 * S}), LIDAR),
    "stamps of TAI": a_silent_group(camera(figures={"delay": -37 * S}), LIDAR),
    "stamps of GPS time since 1970": a_silent_group(camera(figures={"delay": -18 * S}), LIDAR),
    "stamps of local time": a_silent_group(camera(offset=-S, figures={"delay": 7199 * S}), LIDAR),
    **{
        f"stamps that are off the clock that triggers: {name}": a_silent_group(
            *(an_input(each, figures={"delay": None, "delays": (40 * S,) * 20}) for each in ("/camera", "/lidar")),
            **AT_TICKS,
            is_recorded=name == "the recorder's clock",
            clock=ClockState(received=True) if name == "/clock" else None,
        )
        for name in ("this machine's clock", "the recorder's clock", "/clock")
    },
    "stamps of a clock that is ahead": a_silent_group(camera(figures={"delay": -1_995 * MS}), LIDAR, an_input("/imu")),
    "an offset that is wrong": a_silent_group(camera(offset=-1500 * MS, figures={"delay": 5 * MS}), LIDAR),
    "no common key": a_silent_group(
        camera(key="c7"), an_input("/lidar", key="l7"), by_stamp=False, policy="equal_key", tolerance=None
    ),
    "messages that are too old at ticks": a_silent_group(
        camera(figures={"delay": None, "delays": (305 * MS,) * 20, "pace_hz": 10.0}), LIDAR, **AT_TICKS
    ),
    "sets wider than slop": a_silent_group(figures=wide(*[61] * 5, 63)),
    "sets wider than slop, of many widths": a_silent_group(figures=wide(*range(21, 121))),
    "stamps that are never equal": a_silent_group(
        figures=wide(*[0.014] * 5), policy="exact_time", tolerance=Tolerance("slop", 0, "approximate_time")
    ),
    "stamps that are equal mostly": a_group(
        figures=wide(*[0] * 90, *[33] * 10), policy="exact_time", tolerance=Tolerance("slop", 0, "approximate_time")
    ),
    "what is held is too old": a_silent_group(figures=wide(*[700] * 5), **HALF_A_SECOND),
    "what is held is often too old": a_group(figures=wide(*[100] * 5, *[700] * 5), **HALF_A_SECOND),
    "sets wider than slop, whose messages were held up too": a_silent_group(
        camera(figures={"bursts": 1, "held": S}), LIDAR, figures=wide(*[61] * 5, 63)
    ),
    "most sets wider than slop, whose messages were held up too": a_group(
        camera(figures={"bursts": 1, "held": S}), LIDAR, figures=wide(*[5] * 40, *[30] * 60)
    ),
    "sets wider than slop, beside an optional input that was held up": a_group(
        camera(required=False, figures={"bursts": 1, "held": S}),
        LIDAR,
        an_input("/imu"),
        figures=wide(*[5] * 90, *[30] * 10),
    ),
    "some sets wider than slop": a_group(figures=wide(*[5] * 90, *[30] * 10)),
    "stamps that fell": a_group(camera(figures={"fell_by": 2900 * MS, "fell_at": NOW - 3 * S}), LIDAR),
    "disorder": a_group(camera(figures={"out_of_order": 2}), LIDAR),
    "disorder of two publishers": a_group(camera(figures={"out_of_order": 50}, publishers=TWO), LIDAR),
    "two publishers by two clocks": a_silent_group(camera(figures=SWINGING, publishers=TWO), LIDAR),
    "two publishers by two clocks of a group matched by key": a_group(
        camera(figures=SWINGING, publishers=TWO), LIDAR, by_stamp=False
    ),
    "a node that publishes twice": a_group(camera(figures=SWINGING, publishers=(Endpoint("/a", IMAGE),) * 2), LIDAR),
    "three publishers": a_group(camera(figures=SWINGING, publishers=(*TWO, Endpoint("/c", IMAGE))), LIDAR),
    "one publisher of two clocks": a_group(camera(figures=SWINGING), LIDAR),
    "one clock that stepped": a_silent_group(camera(figures={"stepped": Step(NOW - 12 * S, 2 * S)}), LIDAR),
    "one clock that stepped while the others sent nothing": a_silent_group(
        camera(figures={"stepped": Step(NOW - 12 * S, 2 * S)}),
        an_input("/lidar", figures={"last_received": NOW - 20 * S, "flows_since": None}),
    ),
    "the clock of all inputs that stepped": a_group(camera(figures=STEPPED), an_input("/lidar", figures=STEPPED)),
    "this machine's clock that was set": a_group(clock_set=Step(NOW - 12 * S, -2 * S)),
    "stamps that repeat": a_group(camera(figures={"duplicates": 50}), LIDAR),
    "a clock that drifts fast is seen soon": a_silent_group(
        drifting(0.002, watched=8 * S), STEADY, figures=wide(*[30] * 9)
    ),
    "two clocks that drift apart": a_group(
        drifting(0.000_1), an_input("/lidar", figures={"drift": Drift(-0.000_1, 0.0, 60 * S)})
    ),
    "one clock of three that drifts": a_group(
        STEADY, drifting(-0.000_1), an_input("/imu", figures={"drift": Drift(0.000_01, 0.0, 60 * S)})
    ),
    "a clock that drifts": a_group(drifting(0.000_1), STEADY),
    "stamps that lie a constant distance off, nearer to the next message's": a_group(
        camera(figures=stamped(-80 * MS, delay=85 * MS)), an_input("/lidar", figures=stamped(0))
    ),
}

# By the code that must not be found.
QUIETLY = {
    Code.CLOCK_STEP: {
        "a step of one clock while it is not known yet whether another stepped too": a_group(
            camera(figures=STEPPED), an_input("/lidar", figures={"may_step": True})
        ),
    },
    Code.NO_COMMON_KEY: {
        "keys while two publishers have the matching restart": a_silent_group(
            camera(key="c7", figures=SWINGING, publishers=TWO), an_input("/lidar", key="c6"), by_stamp=False
        ),
    },
    Code.CONSTANT_OFFSET: {
        "a constant distance that its delay explains": a_group(
            camera(figures=stamped(0, delay=80 * MS)), an_input("/lidar", figures=stamped(0))
        ),
        "a constant distance of inputs of two rates": a_group(
            camera(figures=stamped(-80 * MS, delay=85 * MS, pace_hz=12)), an_input("/lidar", figures=stamped(0))
        ),
        "a delay of nearly a period by a simulated clock, which comes in ticks": a_group(
            camera(figures=stamped(0, delay=40 * MS)),
            an_input("/lidar", figures=stamped(0, delay=-50 * MS)),
            clock=ClockState(received=True),
        ),
    },
    Code.OTHER_CLOCK: {
        "another clock while sets leave": a_group(camera(figures={"delay": 37_205 * MS}), LIDAR),
        "simulated time that is told late while sets leave": a_group(
            camera(figures={"delay": -997 * MS}), LIDAR, clock=ClockState(received=True)
        ),
        "another clock that its offset makes good": a_silent_group(
            camera(offset=37_200 * MS, figures={"delay": 37_205 * MS}), LIDAR
        ),
        "a latched message of an hour ago": a_silent_group(
            camera(figures={**ONCE, "delay": 3600 * S}), LIDAR, **HALF_A_SECOND
        ),
        "an unstamped input has no clock": a_silent_group(camera(figures={"delay": None}), LIDAR),
        "keys are not stamps": a_silent_group(camera(figures={"delay": 37 * S}), LIDAR, by_stamp=False),
    },
    Code.OVER_SLOP: {
        "nearest sets of before the silence": a_silent_group(figures={"nearest": Distribution([30 * MS] * 50)}),
        "any distance is allowed": a_silent_group(figures=wide(*[30] * 9), tolerance=None),
        "stamps of another clock are not over slop": a_silent_group(
            camera(figures={"delay": 37 * S}), LIDAR, figures=wide(*[30] * 9)
        ),
        "stamps that are apart only because messages came at once": a_group(
            camera(figures={"bursts": 1, "held": S}), LIDAR, figures=wide(3, 3, 3, 3, 300)
        ),
    },
    Code.OUT_OF_ORDER: {
        "disorder of stamps where keys are matched": a_group(
            camera(figures={"out_of_order": 50}), LIDAR, by_stamp=False
        ),
    },
    Code.DUPLICATES: {
        "a state that is sent again and again": a_group(camera(figures={"duplicates": 100}), LIDAR, **AGES),
    },
    Code.CLOCK_DRIFT: {
        "two clocks that drift alike": a_group(
            drifting(0.5), an_input("/lidar", figures={"drift": Drift(0.5, 0.0, 60 * S)})
        ),
    },
}
