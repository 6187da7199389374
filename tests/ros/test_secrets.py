"""What a running relay lets others know: of no variable its value, and over HTTP of no file a line."""

import signal
import socket
from urllib.parse import urlsplit

import pytest

from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs
from tests.ros.processes import Process, wait_until
from tests.ros.reloaded import ReloadedFile
from tests.ros.stage import Stage
from tests.ros.status import address, status

pytestmark = pytest.mark.ros

_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
_SECRETS = {"HOST_NAME": "qzvhostqzv.example", "TOKEN": "qzv p@ss/word qzv", "PIN": "777123777", "NAME": "qzv_name"}
_SHOWN = ("qzv", "777123")
_PAGES = ("/", "/status", "/metrics", "/livez", "/readyz", "/no_such_page")


def _file(**keys: object) -> str:
    front = {"policy": "approximate_time", "slop": "20ms", "topics": inputs(_PAIR), "x-note": "${TOKEN}", **keys}
    metrics = {"listen": "127.0.0.1:0", "hosts": ["${HOST_NAME}"]}
    return config({"front": front}, metrics=metrics)


def _answers(relay: Process) -> str:
    """All that the relay says over HTTP, asked by its own name and by another."""
    place = urlsplit(address(relay))
    said = ""
    for page in _PAGES:
        for host in (place.netloc, "evil.example"):
            with socket.create_connection((place.hostname, place.port), timeout=60) as asked:
                asked.sendall(f"GET {page} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n".encode())
                while part := asked.recv(65536):
                    said += part.decode(errors="replace")
    return said


def test_no_value_of_a_variable_and_over_http_no_line_of_a_file_is_told(stage: Stage):
    stage.environment |= _SECRETS
    file = ReloadedFile(stage, front=_FRONT)
    relay = file.relay
    file.write(_file())
    # What the running relay cannot change is told in the log, as it is written.
    _refused(file)
    relay.wait_for_log("metrics.hosts: not set -> [${HOST_NAME}]")
    # tests/config/test_secrets.py draws what else may be filled in.
    file.write(_file(restamp="/${NAME}"))
    _refused(file)
    assert "restamp" in relay.stderr
    other = stage.folder / "shadow"
    other.write_text("root:$6$qzvqzv:19000:0:99999:7:::\nqzv: [777123\n")
    file.path.unlink()
    file.path.symlink_to(other)
    before = relay.stderr
    _refused(file)
    # The log is for who may read the file.
    assert "qzv" in relay.stderr.removeprefix(before)
    assert not [shown for shown in _SHOWN if shown in before]
    assert status(relay)["relay"]["refused_reloads"] == 3
    said = _answers(relay)
    assert said.count("HTTP/1.1 200 ") >= 4
    assert not [shown for shown in _SHOWN if shown in said]


def _refused(file: ReloadedFile) -> None:
    before = file.count("refused_reloads")
    file.relay.send(signal.SIGHUP)
    wait_until(lambda: file.count("refused_reloads") == before + 1, "the file to be refused")


_FRONT = {"policy": "approximate_time", "slop": "20ms", "topics": inputs(_PAIR)}


def test_a_relay_that_runs_with_variables_tells_none_of_those_that_are_not_in_the_graph(stage: Stage):
    stage.environment |= _SECRETS
    relay = stage.relay(_file())
    relay.wait_for_log("front: waiting for")
    said = _answers(relay) + relay.stderr
    assert said.count("HTTP/1.1 200 ") >= 4
    assert not [shown for shown in _SHOWN if shown in said]
