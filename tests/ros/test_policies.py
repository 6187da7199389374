"""What only a running relay shows of a policy: sets that leave because time passes, keys read from payloads."""

import itertools
import re

import pytest

from tests.ros import relaying
from tests.ros.cdr_messages import VECTOR, stamps_of, vector
from tests.ros.configs import LOSSLESS, ROOMY, config, inputs, outputs
from tests.ros.frames import Frame
from tests.ros.stage import Stage, both_backends
from tests.ros.streams import BEGIN, MS, at

pytestmark = [pytest.mark.ros, both_backends]

_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
_PAIR_OUT = dict.fromkeys(outputs("front", _PAIR), VECTOR)


def _one_set_out(stage: Stage, group: dict, sets) -> list[bytes]:
    """Play sets until they come out; the last one, output by output."""
    collector = stage.collector(_PAIR_OUT)
    stage.relay(config({"front": group}))
    return relaying.one_set(stage.player(_PAIR), collector, sets, list(_PAIR_OUT))[1]


def test_a_set_leaves_without_an_optional_input_when_it_has_waited_enough(stage: Stage):
    # Nothing ever comes on the third topic: only the passing of time can let a set go.
    third = {"topic": "/radar", "type": VECTOR, "required": False}
    group = {"policy": "exact_time", "max_wait": "50ms", "topics": [*inputs(_PAIR, qos=LOSSLESS), third]}
    sets = (at("/camera", offset) + at("/lidar", offset) for offset in itertools.count(0, 100))
    camera, lidar = stamps_of(_one_set_out(stage, group, sets))
    assert camera == lidar


def test_an_open_match_leaves_when_it_has_waited_enough(stage: Stage):
    group = {"policy": "approximate_time", "slop": "20ms", "max_wait": "5ms", "topics": inputs(_PAIR, qos=LOSSLESS)}
    # Each pair is long before the one that was sent before it: it proves nothing of that, and flushes it if it waits.
    falling = range(0, -100_000_000, -10_000)
    pairs = (at("/camera", offset) + at("/lidar", offset + 7) for offset in falling)
    camera, lidar = stamps_of(_one_set_out(stage, group, pairs))
    assert lidar - camera == 7 * MS


def test_messages_of_equal_keys_go_together_whatever_their_stamps(stage: Stage):
    group = {"policy": "equal_key", "key": "header.frame_id", "topics": inputs(_PAIR, qos=LOSSLESS)}

    def keyed(topic: str, seconds: int, key: str) -> Frame:
        return Frame(topic, VECTOR, 0, vector(BEGIN + seconds * 1000 * MS, frame_id=key))

    sets = ([keyed("/camera", n, f"shot {n}"), keyed("/lidar", n + 5, f"shot {n}")] for n in itertools.count())
    camera, lidar = stamps_of(_one_set_out(stage, group, sets))
    assert lidar - camera == 5000 * MS


def test_a_trigger_takes_along_the_latest_of_the_other_input(stage: Stage):
    group = {"policy": "latest_time", "trigger": "/lidar", "topics": inputs(_PAIR, qos=LOSSLESS)}
    sets = (at("/camera", offset, offset + 30) + at("/lidar", offset + 70) for offset in itertools.count(0, 100))
    camera, lidar = stamps_of(_one_set_out(stage, group, sets))
    assert lidar - camera == 40 * MS


def test_thinning_lets_every_third_set_leave_whole(stage: Stage):
    group = {"policy": "exact_time", "every": 3, "queue_size": ROOMY, "topics": inputs(_PAIR, qos=LOSSLESS)}
    recording = at("/camera", *range(0, 900, 10)) + at("/lidar", *range(0, 900, 10))
    recording.sort(key=lambda frame: frame.time)
    collector = stage.collector(_PAIR_OUT)
    stage.relay(config({"front": group}))
    player = stage.player(_PAIR)
    relaying.connect(player, collector, recording, _PAIR_OUT)
    player.play(recording)
    received = [collector.wait_for(output, 30) for output in _PAIR_OUT]
    sets = [stamps_of(relaying.within(recording, payloads)) for payloads in received]
    gaps = {later - earlier for stamps in sets for earlier, later in itertools.pairwise(stamps)}
    assert gaps == {30 * MS}


def test_a_queue_too_short_for_a_late_input_is_told_in_the_summary(stage: Stage):
    # The lidar's one message comes when the camera, ten times as fast, has long filled its queue.
    recording = [*at("/camera", *range(0, 300, 10)), *at("/lidar", 101)]

    def summary_with(queue_size: int) -> tuple[int, str]:
        group = {"policy": "approximate_time", "slop": "5ms", "queue_size": queue_size}
        relay = stage.relay(config({"front": {**group, "topics": inputs(_PAIR, qos=LOSSLESS)}}))
        collector = stage.collector(_PAIR_OUT)
        player = stage.player(_PAIR)
        relaying.connect(player, collector, recording, _PAIR_OUT)
        player.play(recording)
        relaying.conclude(player, collector, recording, _PAIR_OUT)
        for process in (relay, player.process, collector.process):
            process.ask_to_end()
            process.reap()
        return len(relaying.sets_within(recording, collector, _PAIR_OUT)), relay.stderr

    sets, log = summary_with(5)
    assert sets == 0
    assert re.search(r"/camera: .*overflow \d+.*; some left the full queue before their partners came", log), log
    sets, log = summary_with(30)
    assert sets == 1
    assert "before their partners came" not in log
