"""The document of /status: every field, as JSON, and read back."""

import json
import os
from dataclasses import replace

import pytest

from syncrelay import own_version
from syncrelay.explain import Endpoint, Mismatch, Sender, explanation
from syncrelay.status import Level, Phase, level
from syncrelay.status.as_document import group_of, status_of
from syncrelay.status.document import NotAStatusError, read_status
from tests.status.support.states import BEGAN, relay, started, working

_SECOND = replace(started(), facts=replace(started().facts, name="rear"))
STATES = {
    "no group": relay(),
    "starting": relay(started(), phase=Phase.STARTING),
    "nobody publishes": relay(started(camera=(), lidar=())),
    "working": relay(working()),
    "unconfigured": relay(phase=Phase.UNCONFIGURED),
    "draining, two groups": relay(working(), _SECOND, phase=Phase.DRAINING, reloads=2),
}


@pytest.mark.parametrize("state", STATES.values(), ids=STATES)
def test_every_state_is_json_and_is_read_as_it_was_written(state):
    status = status_of(state)
    assert json.loads(json.dumps(status.as_dict(), allow_nan=False)) == json.loads(status.as_json())
    assert read_status(status.as_json()) == status


def test_what_an_older_relay_does_not_send_is_empty_and_what_a_newer_one_adds_is_ignored():
    sent = status_of(relay(working())).as_dict()
    sent["relay"] = {**sent["relay"], "key_of_tomorrow": 1}
    del sent["relay"]["pid"], sent["groups"][0]["inputs"][0]["other_drops"]
    read = read_status(json.dumps(sent).encode())
    assert (read.relay.pid, read.groups[0].inputs[0].other_drops) == (0, None)
    del sent["groups"][0]["sets"]
    with pytest.raises(NotAStatusError, match=r"^groups\.0\.sets: Field required$"):
        read_status(json.dumps(sent).encode())


def test_what_is_said_of_the_relay():
    said = status_of(relay(working(), reloads=3)).as_dict()["relay"]
    assert said.pop("version")
    assert said == {
        "node": "/syncrelay",
        "config": "fusion.yaml",
        "phase": "running",
        "ready": True,
        "uptime_s": 3.2,
        "receives_by": "rclpy",
        "reloads": 3,
        "refused_reloads": 0,
        "reload_error": None,
        "pid": os.getpid(),
    }


def test_what_is_said_of_a_group():
    group = group_of(working()).as_dict()
    assert group.pop("inputs")
    assert {each["code"]: each for each in group.pop("findings")}["healthy"] == {
        "code": "healthy",
        "severity": "ok",
        "text": explanation(working().findings).text,
        "suggestion": None,
        "topic": None,
        "topics": [],
    }
    assert group == {
        "name": "front",
        "policy": "approximate_time",
        "level": "ok",
        "queue_size": 10,
        "tolerance": {"key": "slop", "ms": 20.0},
        "max_wait_ms": None,
        "bundle": None,
        "sets": 30,
        "rate_hz": 10.0,
        "possible_hz": 10.0,
        "since_last_set_ms": 0.0,
        "span_ms": {"p50": 5.0, "p95": 5.0, "max": 5.0},
        "span_without_offsets_ms": None,
        "latency_ms": {"p50": 2.0, "p95": 2.0, "max": 2.0},
        "nearest_ms": {"p50": 5.0, "p95": 5.0, "max": 5.0},
        "last_sets": [{"span_ms": 5.0, "latency_ms": 2.0}] * 30,
        "recent": [{"set": [BEGAN, None]}, {"drop": {"input": 0, "stamp": BEGAN, "reason": "late", "unneeded": False}}],
    }


def test_what_is_said_of_an_input():
    assert group_of(working()).as_dict()["inputs"][0] == {
        "topic": "/camera",
        "type": "sensor_msgs/msg/Image",
        "output": "/front/camera",
        "required": True,
        "offset_ms": 0.0,
        "rate_hz": 11.379,
        "age_ms": 99.0,
        "lag_ms": 1.0,
        "jitter_ms": 0.0,
        "drift_ppm": None,
        "received": 34,
        "matched": 30,
        "buffered": 1,
        "dropped": {"late": 1, "too_far": 2},
        "unneeded": 2,
        "other_drops": {"late": 1},
        "dropped_lately": {"late": 1, "too_far": 2},
        "unneeded_lately": 2,
        "other_drops_lately": {"late": 1},
        "lost": 0,
        "missing": 0.0,
        "publishers": [{"node": "/usb_cam", "type": "sensor_msgs/msg/Image", "mismatch": None}],
        "subscribers": [{"node": "/fusion", "type": "sensor_msgs/msg/Image", "mismatch": None}],
        "senders": [],
    }


def test_of_each_node_it_is_said_what_came_of_its_messages_lately():
    report = working()
    camera, lidar = report.facts.inputs
    senders = Sender("/usb_cam", 200, 188, sent_hz=20.0004, way=350_000, sent_in_all=900), Sender("/gone", 0, 0)
    camera = replace(camera, graph=replace(camera.graph, lost=5, senders=senders))
    said = group_of(replace(report, facts=replace(report.facts, inputs=(camera, lidar)))).as_dict()["inputs"][0]
    assert said["senders"] == [
        {"node": "/usb_cam", "sent": 200, "delivered": 188, "lost": 12, "sent_hz": 20.0, "way_ms": 0.35}
    ]
    assert said["lost"] == 12


def test_what_did_not_happen_yet_is_null_or_empty():
    group = group_of(started()).as_dict()
    assert [group[key] for key in ("since_last_set_ms", "span_ms", "latency_ms", "nearest_ms")] == [None] * 4
    assert [group["inputs"][0][key] for key in ("age_ms", "lag_ms", "jitter_ms", "drift_ppm")] == [None] * 4
    assert group["last_sets"] == []


def test_a_type_is_null_until_the_graph_tells_it():
    unknown = started()
    facts = replace(unknown.facts, inputs=tuple(replace(each, type=None) for each in unknown.facts.inputs))
    said = relay(replace(unknown, facts=facts))
    assert [each["type"] for each in status_of(said).as_dict()["groups"][0]["inputs"]] == [None, None]
    assert not status_of(said).as_dict()["relay"]["ready"]


def test_a_mismatch_says_what_is_offered_and_requested_and_a_finding_its_topic():
    mismatch = Mismatch("durability", "volatile", "transient_local")
    group = status_of(relay(started(camera=(Endpoint("/usb_cam", "sensor_msgs/msg/Image", mismatch),)))).as_dict()[
        "groups"
    ][0]
    assert group["inputs"][0]["publishers"][0]["mismatch"] == {
        "policy": "durability",
        "offered": "volatile",
        "requested": "transient_local",
    }
    assert next((each["code"], each["topic"]) for each in group["findings"]) == ("incompatible_qos", "/camera")


@pytest.mark.parametrize(
    ("report", "expected"),
    [(working(), Level.OK), (started(), Level.OK), (started(camera=(Endpoint("/x", "x/msg/Y"),)), Level.WARN)],
    ids=["works", "starts", "other type"],
)
def test_a_level_is_the_worst_finding(report, expected):
    assert level(report) is expected


def test_what_is_left_of_an_installation_has_no_version(tmp_path, monkeypatch):
    (tmp_path / "syncrelay-9.9.9.dist-info").mkdir()
    monkeypatch.syspath_prepend(tmp_path)
    assert own_version() == "unknown"
