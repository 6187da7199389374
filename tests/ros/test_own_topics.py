"""Which topics are a running relay's own: nobody is to match those."""

from types import SimpleNamespace

import pytest

from syncrelay.config.profile import Profile
from syncrelay.relay import graph
from syncrelay.relay.ports import EndpointInfo

in_process = pytest.importorskip("tests.ros.in_process", reason="rclpy is not installed")

_IMAGE, _MANIFEST = "sensor_msgs/msg/Image", "diagnostic_msgs/msg/DiagnosticArray"


def _is_relayed(name: str, subscribed: dict[str, str], published: dict[str, str]) -> bool:
    """Whether a topic counts as a relay's where its publisher has these topics."""

    def give(topics):
        return lambda _node: {topic: [of_type] for topic, of_type in topics.items()}

    seen = SimpleNamespace(subscribed_by=give(subscribed), published_by=give(published))
    return graph.is_relayed(seen, EndpointInfo("fusion", "/robot", published[name], Profile()), name)


_RELAY = {"/front/camera": _IMAGE, "/robot/fusion/front/sets": _MANIFEST, "/diagnostics": _MANIFEST}


def test_outputs_of_a_relay_are_known_by_its_inputs_and_where_these_sleep_by_its_manifests():
    assert _is_relayed("/front/camera", {"/camera": _IMAGE}, {"/front/camera": _IMAGE})
    assert not _is_relayed("/front/camera", {}, {"/front/camera": _IMAGE})
    assert _is_relayed("/front/camera", {}, _RELAY)


def test_a_manifest_is_no_input_and_what_others_publish_too_is():
    assert _is_relayed("/robot/fusion/front/sets", {"/camera": _IMAGE}, _RELAY)
    assert not _is_relayed("/diagnostics", {"/camera": _IMAGE}, _RELAY)
    other = {"/data/sets": _MANIFEST, "/robot/fusion/sets": _MANIFEST}
    assert not any(_is_relayed(name, {}, other) for name in other)


@pytest.mark.ros
@pytest.mark.parametrize("named", [("_NODE_NAME_UNKNOWN_", "_NODE_NAMESPACE_UNKNOWN_"), ("no name", "/"), ("", "")])
def test_who_has_no_name_of_ros_is_no_relay(ros_domain: int, named: tuple[str, str]):
    publisher = EndpointInfo(*named, _IMAGE, Profile())
    with in_process.own_node(ros_domain) as own:
        assert not graph.is_relayed(in_process.port_of(own.node).graph, publisher, "/front/camera")
