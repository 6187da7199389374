"""The relay as a node among others: names, remaps, simulated time, and its talk."""

import json
import re
import signal
from pathlib import Path
from typing import Any

import pytest
from rosbags.typesys import Stores, get_typestore

from tests.ros import relaying
from tests.ros.cdr_messages import VECTOR, stamps_of
from tests.ros.configs import LOSSLESS, config, inputs
from tests.ros.processes import Process, wait_until
from tests.ros.stage import Stage
from tests.ros.streams import at, merged

pytestmark = pytest.mark.ros

_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
_LOG = "rcl_interfaces/msg/Log"
_STORE = get_typestore(Stores.ROS2_JAZZY)
_PAIR_OUT = {"/front/camera": VECTOR, "/front/lidar": VECTOR}


def _front(**keys) -> str:
    return config({"front": {"policy": "exact_time", "topics": inputs(_PAIR, qos=LOSSLESS)}}, **keys)


def _end(relay: Process) -> None:
    relay.send(signal.SIGTERM)
    assert relay.wait() == 0


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


def test_rosout_says_where_a_line_was_logged(stage: Stage):
    collector = stage.collector({"/rosout": _LOG})
    stage.relay(_front())

    def lines() -> list[Any]:
        heard: list[Any] = [_STORE.deserialize_cdr(payload, _LOG) for payload in collector.payloads("/rosout")]
        return [each for each in heard if each.msg.startswith("front: waiting for")]

    wait_until(lines, "the line that it waits for publishers, on /rosout")
    line = lines()[0]
    assert (line.name, line.level) == ("syncrelay", 20)
    text = Path(line.file).read_text().splitlines()[line.line - 1]
    assert "_LOG." in text, (line.file, line.line)
