"""The services and parameters of the relay's node: called and read by a process of their own."""

from importlib.metadata import version

import pytest

from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import LOSSLESS, ROOMY, config, inputs
from tests.ros.reloaded import ReloadedFile
from tests.ros.stage import Stage
from tests.ros.status import ANY_PORT

pytestmark = pytest.mark.ros

_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
_FRONT = {"policy": "approximate_time", "queue_size": ROOMY, "slop": "20ms", "topics": inputs(_PAIR, qos=LOSSLESS)}
_REAR = {"policy": "exact_time", "topics": inputs(_PAIR, qos=LOSSLESS)}


def test_a_reload_by_service_says_what_changed_or_what_is_wrong_with_the_file(stage: Stage):
    file, caller = ReloadedFile(stage, front=_FRONT), stage.caller()
    file.write(config({"front": _FRONT, "rear": _REAR}, metrics=ANY_PORT))
    assert caller.call("reload") == (True, "reloaded: 1 group unchanged; started rear")
    assert caller.get("config", "version", "groups") == [[str(file.path)], version("syncrelay"), ["front", "rear"]]
    for name, value in (("config", ["other.yaml"]), ("version", "0"), ("groups", ["front"])):
        successful, why = caller.set(name, value)
        assert not successful
        assert name in why
    assert caller.get("groups") == [["front", "rear"]]
    file.write(config({"front": {**_FRONT, "slop": "30ms"}}, metrics=ANY_PORT))
    assert caller.call("reload") == (True, "reloaded: 0 groups unchanged; rebuilt front; ended rear")
    file.write(config({"front": {**_FRONT, "slopp": "1ms"}}, metrics=ANY_PORT))
    success, text = caller.call("reload")
    assert not success
    assert text in file.relay.stderr
    assert "groups.front.slopp: unknown key, did you mean `slop`?" in text
    success, text = caller.call("status")
    assert success
    assert text.startswith("/syncrelay: ")
    assert "front: OK; no set yet" in text
