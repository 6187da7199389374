"""Which topics are a running relay's own: nobody is to match those."""

from types import SimpleNamespace

import pytest

own_node = pytest.importorskip("tests.ros.in_process", reason="rclpy is not installed").own_node
graph = pytest.importorskip("syncrelay.ros.graph", reason="rclpy is not installed")

_IMAGE, _MANIFEST = "sensor_msgs/msg/Image", "diagnostic_msgs/msg/DiagnosticArray"


def _graph(subscribed: dict[str, str], published: dict[str, str]) -> SimpleNamespace:
    """A node of rclpy's that sees one other, which has these topics."""

    def give(topics):
        return lambda _name, _namespace: [(topic, [of_type]) for topic, of_type in topics.items()]

    return SimpleNamespace(
        get_subscriber_names_and_types_by_node=give(subscribed),
        get_publisher_names_and_types_by_node=give(published),
    )


def _is_relayed(name: str, subscribed: dict[str, str], published: dict[str, str]) -> bool:
    publisher = SimpleNamespace(node_name="fusion", node_namespace="/robot", topic_type=published[name])
    return graph.is_relayed(_graph(subscribed, published), publisher, name)


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
    name, namespace = named
    publisher = SimpleNamespace(node_name=name, node_namespace=namespace, topic_type=_IMAGE)
    with own_node(ros_domain) as own:
        assert not graph.is_relayed(own.node, publisher, "/front/camera")
