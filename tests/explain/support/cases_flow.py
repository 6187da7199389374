"""What the flow tells: facts that come to a finding, and the nearest that do not."""

from syncrelay.config.profile import Profile
from syncrelay.explain import Code, Distribution, Pause, Sender, Share, Standing, Standstill
from syncrelay.sync.messages import DropReason
from tests.explain.support.cases import AGES, LIDAR, camera, dropped, fed, overflowing, without_camera
from tests.explain.support.groups import MS, NOW, S, a_group, a_silent_group, an_input

HELD_UP = {"bursts": 1, "held": 2 * S, "held_up": [(NOW - 4 * S, NOW - 2 * S)]}
FEW = {"standing": Standing.FEW}


def undelivered(count, gap, *, lost=0, others=(), figures=None, sent_hz=20.0, **profile):
    """An input of which so many of 200 messages did not arrive, at most `gap` in a row; DDS says that it lost some."""
    sender = Sender("/usb_cam", 200, 200 - count, longest_gap=gap, sent_hz=sent_hz)
    return camera(senders=(sender, *others), lost=lost, profile=Profile(**profile), figures=figures)


def held_up(begin, end):
    return camera(figures={"bursts": 1, "held": end - begin, "held_up": [(begin, end)]})


# What is said of each stands in tests/explain/findings.txt.
FOUND = {
    "a group that somebody paused": a_silent_group(camera(), LIDAR, pause=Pause(NOW - 12 * S, "/syncrelay/resume")),
    "a queue that is too short": a_silent_group(overflowing(40), LIDAR),
    "a queue that is too short at times": a_group(overflowing(40), LIDAR, figures={"rate_hz": 9.0}),
    "sets without an optional input": a_group(
        camera(required=False), LIDAR, an_input("/imu"), figures={"missing": (1.0, 0.0, 0.0)}, max_wait=100 * MS
    ),
    "an optional input whose stamps fit no set": without_camera(
        delay=45 * MS, nearest=Distribution([40 * MS] * 99 + [63 * MS])
    ),
    "an optional input of another clock": without_camera(delay=37_205 * MS, nearest=Distribution([40 * MS] * 100)),
    "an optional input of another clock that was never near": without_camera(delay=37_205 * MS),
    "an optional input that comes late": without_camera(delay=305 * MS, nearest=Distribution([3 * MS] * 100)),
    "an optional input that comes late, and seldom": without_camera(
        delay=305 * MS, nearest=Distribution([3 * MS] * 100), rate_hz=2.0, usual_hz=2.0, pace_hz=2.0
    ),
    "an optional input that went away": without_camera(
        delay=305 * MS, nearest=Distribution([3 * MS] * 100), last_received=NOW - 4 * S
    ),
    "an optional input that never came": without_camera(last_received=None),
    "an optional input that comes in time and is missing all the same": without_camera(
        delay=104 * MS, nearest=Distribution([3 * MS] * 100)
    ),
    "messages that were held up": a_group(camera(figures={"bursts": 4, "held": 2900 * MS}), LIDAR),
    "messages of all inputs that were held up together": a_group(
        held_up(NOW - 4 * S, NOW - 2 * S), an_input("/lidar", figures=HELD_UP)
    ),
    "messages of all inputs that were recorded late together": a_group(
        held_up(NOW - 4 * S, NOW - 2 * S), an_input("/lidar", figures=HELD_UP), is_recorded=True
    ),
    "messages of two inputs of three that were held up together": a_group(
        held_up(NOW - 3 * S, NOW - S), an_input("/lidar", figures=HELD_UP), an_input("/imu")
    ),
    "messages that were recorded in a burst": a_group(held_up(NOW - 3 * S, NOW - S), LIDAR, is_recorded=True),
    "a standstill in which messages were missed": a_group(
        camera(figures={"longest_pause": 3 * S, "last_received": NOW - S}),
        LIDAR,
        standstills=(Standstill(NOW - S, 3 * S),),
    ),
    "a standstill after which only the last of the missed messages came": a_group(
        camera(figures={"longest_pause": 3 * S, "last_received": NOW - S}),
        LIDAR,
        waited=900 * MS,
        standstills=(Standstill(NOW - S, 3 * S),),
    ),
    "a message that DDS lost": a_group(camera(lost=1), LIDAR),
    "messages that came too many at once": a_group(undelivered(12, 4, depth=1), LIDAR),
    "messages of two publishers that came too many at once": a_group(
        undelivered(12, 4, others=[Sender("/other", 90, 85, longest_gap=2), Sender("/third", 90, 90)]), LIDAR
    ),
    "messages of best effort that were lost": a_group(undelivered(12, 1, lost=12, reliability="best_effort"), LIDAR),
    "fewer messages of best effort than a history holds": a_group(
        undelivered(194, 60, reliability="best_effort"), LIDAR
    ),
    "messages that were lost though they are reliable": a_group(undelivered(12, 9, lost=7), LIDAR),
    "an input that came slowly because messages were lost": a_group(
        undelivered(100, 4, depth=1, figures={"pace_hz": 2.0, "slowed_from_hz": 10.0}), LIDAR
    ),
    "a relay that does not keep up": a_group(waited=700 * MS),
    "messages that came at once when a standstill was over": a_group(
        # The last second of them by the network, which sends again what it could not deliver.
        camera(figures={"bursts": 1, "held": 4 * S, "held_up": [(NOW - 8 * S, NOW - 4 * S)]}),
        LIDAR,
        standstills=(Standstill(NOW - 5 * S, 2 * S),),
    ),
    "an input that comes at a tenth of its rate": a_group(
        camera(figures={"pace_hz": 1.0, "slowed_from_hz": 10.0}), LIDAR
    ),
    "few sets": a_group(dropped(DropReason.LATE, 60), LIDAR, figures={"share": Share(40, 100, 10 * S, 0)}, **FEW),
    "few sets since a silence": a_group(
        dropped(DropReason.LATE, 60),
        LIDAR,
        figures={"share": Share(1, 100, 10 * S, 0)},
        standing=Standing.NONE,
    ),
    "few sets of an input that pauses": a_group(
        camera(), LIDAR, figures={"share": Share(60, 100, 10 * S, 0, absent=40)}, **FEW
    ),
    "sets that are often too wide for an input that pauses": a_group(
        camera(figures={"received": tuple(NOW - n * 100 * MS for n in (50, 49, 19, *range(18, -1, -1)))}),
        LIDAR,
        figures={"nearest": Distribution([3 * MS] * 60 + [500 * MS] * 30 + [3 * MS] * 10)},
    ),
    "few sets of a trigger, told by its own messages": a_group(
        an_input("/map", figures={"rate_hz": 1.0}),
        dropped(DropReason.EXPIRED, 60),
        figures={"share": Share(40, 100, 10 * S, 1)},
        **FEW,
        **AGES,
    ),
    "what nothing explains": a_silent_group(
        camera(figures={"dropped": {DropReason.TOO_FAR: 90, DropReason.LATE: 3}}),
        an_input("/lidar", figures={"fed": 0}),
    ),
    "a start": a_group(figures={"began": NOW - 3 * S, "last_set": None}),
    "health": a_group(),
}

# By the code that must not be found.
QUIETLY = {
    Code.SHORT_QUEUE: {
        "an overflow of what nobody missed": a_silent_group(overflowing(None), LIDAR),
        "an overflow beside a stream of another clock": a_silent_group(
            overflowing(40), an_input("/lidar", figures={"delay": 37 * S})
        ),
        "an overflow long ago": a_silent_group(camera(counts=fed(needed_queue=40)), LIDAR),
    },
    Code.BURSTS: {
        "messages that came at once because the relay stood still": a_group(
            camera(figures={"bursts": 1, "held": S}), LIDAR, waited=S
        ),
    },
    Code.TOO_SLOW: {
        "a standstill in which no message came": a_group(standstills=(Standstill(NOW - S, 3 * S),)),
        "messages that came at once at another time than that of a standstill": a_group(
            camera(figures={"bursts": 1, "held": S, "held_up": [(NOW - 5 * S, NOW - 4 * S)]}),
            LIDAR,
            standstills=(Standstill(NOW - 5 * S, 2 * S),),
        ),
    },
    Code.FEW_SETS: {
        "few sets while none leaves": a_silent_group(figures={"share": Share(40, 100, 10 * S)}, standing=Standing.NONE),
    },
    Code.STARTING: {
        "no set yet where something is wrong": a_group(
            camera(not_importable="no package"), LIDAR, figures={"began": NOW - 3 * S, "last_set": None}
        ),
    },
}
