"""The services and parameters of the relay's node: called and read by a process of their own."""

import os
import random
import re
import signal
from importlib.metadata import version
from urllib.error import HTTPError

import pytest

from tests.ros import relaying
from tests.ros.cdr_messages import VECTOR, stamp_of, stamps_of
from tests.ros.configs import LOSSLESS, ROOMY, config, inputs
from tests.ros.processes import wait_until
from tests.ros.reloaded import ReloadedFile
from tests.ros.stage import Stage, both_backends
from tests.ros.status import ANY_PORT, findings, first_group, get, status, wait_for_finding
from tests.ros.streams import at, merged

pytestmark = pytest.mark.ros

_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
_FRONT = {"policy": "approximate_time", "queue_size": ROOMY, "slop": "20ms", "topics": inputs(_PAIR, qos=LOSSLESS)}
_REAR = {"policy": "exact_time", "topics": inputs(_PAIR, qos=LOSSLESS)}
_OUTPUTS = {"/front/camera": VECTOR, "/front/lidar": VECTOR}
_OFFERED = [f"/syncrelay/{name}" for name in ("pause", "reload", "resume", "status")]


def _file(**groups) -> str:
    return config(groups, metrics=ANY_PORT)


def _front(relay) -> list[dict]:
    return first_group(relay)["inputs"]


def test_a_reload_by_service_says_what_changed_and_parameters_tell_what_runs(stage: Stage):
    file, caller = ReloadedFile(stage, front=_FRONT), stage.caller()
    file.write(_file(front=_FRONT, rear=_REAR))
    assert caller.call("reload") == (True, "reloaded: 1 group unchanged; started rear")
    assert caller.get("config", "version", "groups") == [[str(file.path)], version("syncrelay"), ["front", "rear"]]
    for name, value in (("config", ["other.yaml"]), ("version", "0"), ("groups", ["front"])):
        successful, why = caller.set(name, value)
        assert not successful
        assert name in why
    file.write(_file(front={**_FRONT, "slop": "30ms"}))
    assert caller.call("reload") == (True, "reloaded: 0 groups unchanged; rebuilt front; ended rear")
    assert caller.get("groups") == [["front"]]
    file.write(_file(front={**_FRONT, "slopp": "1ms"}))
    success, why = caller.call("reload")
    assert not success
    assert "groups.front.slopp: unknown key, did you mean `slop`?" in why
    assert why in file.relay.stderr
    success, text = caller.call("status")
    assert success
    assert text.startswith("/syncrelay: ")
    # What it says of it hangs on how long there was no set.
    assert re.search(r"front: [A-Z]+", text), text
    wait_until(lambda: set(caller.services()) >= set(_OFFERED), "all services in the graph")


def test_services_can_be_switched_off(stage: Stage):
    stage.relay(config({"front": _FRONT}, node={"services": False})).wait_for_log("front: waiting for")
    caller = stage.caller()
    assert caller.get("groups") == [["front"]]
    services = caller.services()
    assert "/syncrelay/get_parameters" in services
    assert set(services).isdisjoint(_OFFERED)


@both_backends
def test_while_paused_nothing_leaves_and_all_is_counted_and_what_comes_after_is_matched(stage: Stage):
    front = {**_REAR, "queue_size": ROOMY}
    file, caller, collector = ReloadedFile(stage, front=front), stage.caller(), stage.collector(_OUTPUTS)
    player, relay = stage.player(_PAIR), file.relay
    times = range(0, 500, 10)
    before, within, after = (merged(at("/camera", *part), at("/lidar", *part)) for part in _parts(times))
    n_sent = relaying.connect(player, collector, before, _OUTPUTS)

    def play(recording, n_more: int) -> None:
        nonlocal n_sent
        player.play(recording)
        n_sent += n_more
        wait_until(lambda: [each["received"] for each in _front(relay)] == [n_sent, n_sent - 1], "the counts")

    n_sent += 1
    player.play(at("/camera", -50))
    play(before, len(before) // 2)
    last = stamp_of(before[-1].payload)
    wait_until(lambda: last in stamps_of(collector.payloads("/front/lidar")), "the last set before the pause")
    assert caller.call("pause") == (True, "paused: nothing leaves until ~/resume is called")
    assert caller.call("pause") == (True, "paused already")
    n_sets = collector.count("/front/lidar")
    file.reload(front=front, rear=_REAR)
    play(within, len(within) // 2)
    assert collector.count("/front/lidar") == n_sets
    assert [wait_for_finding(relay, "paused", name)["severity"] for name in ("front", "rear")] == ["warn"] * 2
    assert status(relay)["relay"]["phase"] == "paused"
    with pytest.raises(HTTPError, match="503"):
        get(relay, "/readyz")
    assert "front: WARN" in caller.call("status")[1]
    assert caller.call("resume") == (True, "resumed")
    assert caller.call("resume") == (True, "not paused")
    play(after, len(after) // 2)
    collector.wait_for("/front/lidar", n_sets + len(after) // 2)
    sent = stamps_of(relaying.within(merged(before, within, after), collector.payloads("/front/lidar")))
    assert sent == sorted(stamps_of([frame.payload for frame in [*before, *after] if frame.topic == "/lidar"]))
    n_paused = len(within) // 2
    wait_until(lambda: _front(relay)[1]["matched"] == n_sent - 1 - n_paused, "the counts of all")
    camera, lidar = _front(relay)
    assert camera["dropped"]["superseded"] + camera["dropped"]["paused"] == 1 + n_paused
    assert lidar["dropped"] == {"paused": n_paused}
    wait_until(lambda: "paused" not in findings(relay), "the end of the finding")
    assert 'outcome="paused"' in get(relay, "/metrics")


def _parts(times: range) -> list[range]:
    third = len(times) // 3
    return [times[begin : begin + third] for begin in (0, third, 2 * third)]


# However long a busy machine takes for the other calls meanwhile.
_PATIENT = """
from syncrelay.config import rereading
rereading._PIPE_S, rereading._PATIENCE_S = 15.0, 60.0
"""


def test_a_pipe_that_hangs_holds_up_no_other_service_and_an_end_answers_who_waits(stage: Stage):
    stage.before_each_relay(_PATIENT)
    file, caller = ReloadedFile(stage, front=_FRONT), stage.caller()
    os.mkfifo(file.path.with_suffix(".pipe"))
    file.path.with_suffix(".pipe").replace(file.path)
    caller.begin("reload")
    assert caller.call("status")[0]
    assert caller.call("pause")[0]
    assert caller.get("groups") == [["front"]]
    (told,) = caller.end()
    assert not told[0]
    assert "is it a pipe that nobody writes to" in told[1]
    caller.begin("reload")
    caller.begin("reload")
    # All calls before it have been taken by then.
    assert caller.call("status")[0]
    file.relay.send(signal.SIGTERM)
    assert caller.end() == [(False, "the relay is ending")] * 2
    assert file.relay.wait() == 0


def test_random_calls_signals_and_changes_are_all_answered_and_no_set_is_wrong(stage: Stage):
    chance = random.Random(16)
    camera = at("/camera", *range(0, 60_000, 10))
    recording = merged(camera, at("/lidar", *range(0, 60_000, 10)))
    file, caller, collector = ReloadedFile(stage, front=_REAR), stage.caller(), stage.collector(_OUTPUTS)
    player = stage.player(_PAIR)
    relaying.connect(player, collector, recording, _OUTPUTS)
    player.start(recording, speed=4)
    texts = [_file(front=_REAR), _file(front=_REAR, rear=_FRONT), _file(front={**_REAR, "queue_size": 7}), "version: 2"]
    n_begun = 0
    for _ in range(60):
        match chance.choice(["call", "call", "begin", "signal", "write", "write"]):
            case "call":
                caller.call(chance.choice(["reload", "status", "pause", "resume"]))
            case "begin":
                caller.begin(chance.choice(["reload", "pause", "resume"]))
                n_begun += 1
            case "signal":
                file.relay.send(signal.SIGHUP)
            case "write":
                file.write(chance.choice(texts))
    assert len(caller.end()) == n_begun
    player.stop()
    file.write(_file(front=_REAR))
    assert caller.call("reload")[0]
    assert caller.call("resume")[0]
    relaying.conclude(player, collector, recording, _OUTPUTS)
    left, right = (stamps_of(relaying.within(recording, collector.payloads(output))) for output in _OUTPUTS)
    assert left == right
    assert left == sorted(set(left))
    assert "a bug in syncrelay" not in file.relay.stderr
