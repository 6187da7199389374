"""The services and parameters of the relay's node: called and read by a process of their own."""

import os
import signal
from importlib.metadata import version

import pytest

from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import LOSSLESS, ROOMY, config, inputs
from tests.ros.processes import wait_until
from tests.ros.reloaded import ReloadedFile
from tests.ros.stage import Stage
from tests.ros.status import ANY_PORT

pytestmark = pytest.mark.ros

_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
_FRONT = {"policy": "approximate_time", "queue_size": ROOMY, "slop": "20ms", "topics": inputs(_PAIR, qos=LOSSLESS)}
_REAR = {"policy": "exact_time", "topics": inputs(_PAIR, qos=LOSSLESS)}
_OFFERED = [f"/syncrelay/{name}" for name in ("pause", "reload", "resume", "status")]


def test_a_reload_by_service_says_what_changed_and_parameters_tell_what_runs(stage: Stage):
    file, caller = ReloadedFile(stage, front=_FRONT), stage.caller()
    file.write(config({"front": _FRONT, "rear": _REAR}, metrics=ANY_PORT))
    assert caller.call("reload") == (True, "reloaded: 1 group unchanged; started rear")
    assert caller.get("config", "version", "groups") == [[str(file.path)], version("syncrelay"), ["front", "rear"]]
    for name, value in (("config", ["other.yaml"]), ("version", "0"), ("groups", ["front"])):
        successful, why = caller.set(name, value)
        assert not successful
        assert name in why
    wait_until(lambda: set(caller.services()) >= set(_OFFERED), "all services in the graph")


def test_services_can_be_switched_off(stage: Stage):
    stage.relay(config({"front": _FRONT}, node={"services": False})).wait_for_log("front: waiting for")
    caller = stage.caller()
    assert caller.get("groups") == [["front"]]
    services = caller.services()
    assert "/syncrelay/get_parameters" in services
    assert set(services).isdisjoint(_OFFERED)


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
    caller.begin("reload")
    # All calls before it have been taken by then.
    assert caller.call("status")[0]
    file.relay.send(signal.SIGTERM)
    assert caller.end() == [(False, "the relay is ending")] * 2
    assert file.relay.wait() == 0
