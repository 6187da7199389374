"""The node's own topics: refused only as long as they are its own."""

import json
from typing import Any

import pytest

from syncrelay.config import ConfigError, load_text

_LOG = {"topic": "/rosout", "type": "rcl_interfaces/msg/Log", "stamp": {"field": "stamp"}}
_SPAN = "/syncrelay/front/span_ms"


def _file(topic: dict[str, Any], **top: Any) -> str:
    other = {"topic": "/b", "type": "sensor_msgs/msg/Image"}
    group = {"policy": "exact_time", "topics": [{"type": "sensor_msgs/msg/Image", **topic}, other]}
    return json.dumps({"version": 1, "groups": {"front": group}, **top})


def _codes(text: str) -> list[str]:
    try:
        load_text(text, environ={})
    except ConfigError as error:
        return [problem.code for problem in error.problems if problem.code != "not_checked"]
    return []


@pytest.mark.parametrize(
    ("refused", "allowed"),
    [
        pytest.param(
            _file({"topic": "/a", "output": "/diagnostics"}),
            _file({"topic": "/a", "output": "/diagnostics"}, diagnostics=None),
            id="diagnostics that are off",
        ),
        pytest.param(
            _file({"topic": "/a", "output": _SPAN}, diagnostics={"scalars": True}),
            _file({"topic": "/a", "output": _SPAN}, diagnostics={"scalars": False}),
            id="figures that are off",
        ),
        pytest.param(
            _file({"topic": "/a", "output": _SPAN}, diagnostics={"scalars": True}),
            _file({"topic": "/a", "output": _SPAN}, diagnostics={"scalars": True}, node={"namespace": "/robot"}),
            id="figures of a node of another name",
        ),
        pytest.param(
            _file({"topic": "/a", "output": "~/transition_event"}, node={"lifecycle": True}),
            _file({"topic": "/a", "output": "~/transition_event"}),
            id="transitions of a managed node",
        ),
        pytest.param(_file({"topic": "/rosout"}), _file(_LOG), id="the log of others, of its type"),
    ],
)
def test_a_topic_is_the_nodes_own_where_it_uses_it(refused: str, allowed: str):
    assert _codes(refused) in (["own_topic"], ["conflict"])
    assert _codes(allowed) == []


def test_a_manifest_is_no_input_of_its_own_node_whether_its_type_is_written_or_not():
    for of_type in ({"type": "diagnostic_msgs/msg/DiagnosticArray"}, {}):
        topics = [{"topic": "/syncrelay/front/sets", **of_type}, {"topic": "/b", "type": "sensor_msgs/msg/Image"}]
        group = {"policy": "exact_time", "topics": topics}
        assert _codes(json.dumps({"version": 1, "groups": {"front": group}}))[-1:] == ["loop"]
