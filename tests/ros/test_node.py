"""The relay as a node among others: names, remaps, simulated time, and its talk."""

import itertools
import json
import re
import signal
from collections.abc import Sequence

import pytest

from tests.ros import relaying
from tests.ros.cdr_messages import CLOCK, NS_PER_SECOND, VECTOR, serialize, stamps_of, time
from tests.ros.configs import LOSSLESS, config, inputs
from tests.ros.frames import Frame
from tests.ros.processes import Process, wait_until
from tests.ros.stage import Stage
from tests.ros.streams import at, merged
from tests.ros.summary import read_summary

pytestmark = pytest.mark.ros

_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
_PAIR_OUT = {"/front/camera": VECTOR, "/front/lidar": VECTOR}
_RECORDING = merged(at("/camera", 0, 10, 20), at("/lidar", 0, 10, 20))


def _front(**keys) -> str:
    return config({"front": {"policy": "exact_time", "topics": inputs(_PAIR, qos=LOSSLESS)}}, **keys)


def _end(relay: Process) -> None:
    relay.send(signal.SIGTERM)
    assert relay.wait() == 0


@pytest.mark.parametrize(
    ("node", "arguments", "full_name"),
    [
        ({}, [], "/syncrelay"),
        ({"name": "fusion", "namespace": "/robot"}, ["--ros-args", "-r", "__node:=other"], "/robot/other"),
        ({"name": "fusion"}, ["--ros-args", "-r", "__ns:=/left"], "/left/fusion"),
    ],
)
def test_the_node_is_named_by_the_file_and_the_command_line_has_the_last_word(
    stage: Stage, node: dict[str, str], arguments: Sequence[str], full_name: str
):
    collector = stage.collector()
    relay = stage.relay(_front(node=node), *arguments)
    collector.process.wait_until(lambda: full_name in collector.nodes(), full_name)
    relay.wait_for_log(f"[{full_name.removeprefix('/').replace('/', '.')}]: front: waiting for")


def test_outputs_are_named_as_the_file_says_and_remaps_have_the_last_word(stage: Stage):
    topics = inputs({**_PAIR, "/imu": VECTOR}, qos=LOSSLESS)
    topics[0]["output"] = "/fused/image"
    text = config({"front": {"policy": "exact_time", "output_prefix": "/aligned", "topics": topics}})
    recording = merged(*(at(topic, 0, 10, 20) for topic in ("/robot/camera", "/lidar", "/imu")))
    aligned = dict.fromkeys(["/fused/image", "/aligned/lidar", "/fused/imu"], VECTOR)
    remaps = ["-r", "/camera:=/robot/camera", "-r", "/aligned/imu:=/fused/imu"]
    _, collector = relaying.relay(stage, text, recording, aligned, arguments=["--ros-args", *remaps])
    expected = [(frame.payload,) * 3 for frame in at("", 0, 10, 20)]
    assert relaying.sets_within(recording, collector, aligned) == expected


def test_two_robots_that_run_one_file_in_namespaces_of_their_own_keep_their_sets_apart(stage: Stage):
    offsets = {"/robot1": (0, 10, 20), "/robot2": (5, 15, 25, 35)}
    recording = merged(*(at(f"{ns}/{name}", *offsets[ns]) for ns in offsets for name in ("camera", "lidar")))
    outputs = {ns: [f"{ns}/front/camera", f"{ns}/front/lidar"] for ns in offsets}
    relative = {"policy": "exact_time", "topics": inputs({"camera": VECTOR, "lidar": VECTOR}, qos=LOSSLESS)}
    text = config({"front": relative})
    aligned = dict.fromkeys([name for names in outputs.values() for name in names], VECTOR)
    stage.relay(text, "--ros-args", "-r", "__ns:=/robot2")
    _, collector = relaying.relay(stage, text, recording, aligned, arguments=["--ros-args", "-r", "__ns:=/robot1"])
    for ns, names in outputs.items():
        expected = [(frame.payload, frame.payload) for frame in at("", *offsets[ns])]
        assert relaying.sets_within(recording, collector, names) == expected


def test_keys_of_the_file_among_the_parameters_are_warned_of_once_and_change_nothing(stage: Stage):
    given = stage.folder / "parameters.yaml"
    given.write_text("/**: {ros__parameters: {queue_size: 5, frame_id: base, use_sim_time: false}}")
    recording = merged(at("/camera", 0, 10, 20), at("/lidar", 3, 13, 23), at("/camera", 30), at("/lidar", 30))
    arguments = ["--ros-args", "-p", "slop:=0.5", "--params-file", str(given)]
    relay, collector = relaying.relay(stage, _front(), recording, _PAIR_OUT, arguments=arguments)
    assert [stamps_of(list(pair))[0] for pair in relaying.sets_within(recording, collector, _PAIR_OUT)] == [
        at("", 30)[0].time
    ]
    _end(relay)
    said = [line for line in relay.stderr.splitlines() if "[WARN]" in line and "ROS parameters" in line]
    assert len(said) == 1
    assert re.search(r"`(slop|queue_size)` and `(slop|queue_size)` belong in the file, in a group$", said[0])


def _tick(seconds: int) -> Frame:
    return Frame("/clock", CLOCK, 0, serialize(CLOCK, time(seconds * NS_PER_SECOND)))


@pytest.mark.parametrize(
    ("node", "arguments"),
    [({"use_sim_time": True}, []), ({}, ["--ros-args", "-p", "use_sim_time:=true"])],
    ids=["by_the_file", "by_the_command_line"],
)
def test_when_simulated_time_begins_again_what_is_buffered_is_dropped(
    stage: Stage, node: dict[str, bool], arguments: Sequence[str]
):
    collector = stage.collector(_PAIR_OUT)
    relay = stage.relay(_front(node=node), *arguments)
    player = stage.player({**_PAIR, "/clock": CLOCK})
    relaying.connect(player, collector, _RECORDING, _PAIR_OUT)
    wait_until(lambda: collector.endpoints("/clock", kind="subscription", node="/syncrelay"), "who listens to /clock")
    # The pair comes out behind the camera's lone message, which by then must be in the buffer.
    before = collector.count("/front/lidar")
    player.play(at("/camera", 100) + at("/camera", 0) + at("/lidar", 0))
    collector.wait_for("/front/lidar", before + 1)

    ticks = itertools.cycle([100, 50])

    def has_jumped() -> bool:
        # One at a time: of two ticks that come at once the relay may get the later one only.
        player.play([_tick(next(ticks))])
        return "jumped" in relay.stderr

    wait_until(has_jumped, "simulated time to begin again")
    _end(relay)
    assert read_summary(relay.stderr)["front"].inputs["/camera"].dropped == {"time_jump": 1}


def test_json_logs_are_an_object_a_line_on_stderr_of_the_level_that_is_asked_for(stage: Stage):
    words = [["--log-format", "json"], ["--log-level", "error"]]
    told, silent = (stage.relay(_front(), *each) for each in words)
    told.wait_for_log('"front: waiting for')
    silent.wait_until(lambda: silent.handles(signal.SIGTERM), "its handler of signals")
    for relay in (told, silent):
        _end(relay)
    lines = [json.loads(line) for line in told.said]
    assert all({"time", "level", "logger", "message"} <= line.keys() for line in lines)
    assert any(line["message"].startswith("front: waiting for") and line["group"] == "front" for line in lines)
    assert told.stdout == ""
    # On a slow machine an error may be said that nobody publishes.
    assert not re.search(r"\[(INFO|WARN)\]", silent.stderr)
