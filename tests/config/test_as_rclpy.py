"""What rclpy accepts is what the file accepts."""

from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.config.names import check_namespace, check_node_name, check_topic_name, expand
from syncrelay.config.qos import PresetName, QosOverrides

expand_topic_name = pytest.importorskip("rclpy.expand_topic_name").expand_topic_name
validate_full_topic_name = pytest.importorskip("rclpy.validate_full_topic_name").validate_full_topic_name
validate_namespace = pytest.importorskip("rclpy.validate_namespace").validate_namespace
validate_node_name = pytest.importorskip("rclpy.validate_node_name").validate_node_name
NameValidationException = pytest.importorskip("rclpy.exceptions").NameValidationException
qos = pytest.importorskip("rclpy.qos")

# Short enough that no namespace makes them too long.
NAMES = st.text(alphabet="ab_/~1- é\n", max_size=8)


def accepts(check, name):
    try:
        return bool(check(name))
    except (ValueError, NameValidationException):
        return False


@given(NAMES)
def test_topic_names_are_judged_as_rclpy_judges_them(name):
    judged = accepts(lambda topic: validate_full_topic_name(expand_topic_name(topic, "n", "/")), name)
    # rclpy takes the node's own name alone, and `~1` as a longer one; what stands below the node begins with `~/`.
    assert accepts(check_topic_name, name) == (judged and name.startswith("~/") == name.startswith("~"))


@given(NAMES)
def test_node_names_are_judged_as_rclpy_judges_them(name):
    assert accepts(check_node_name, name) == accepts(validate_node_name, name)


@given(NAMES.filter(bool))
def test_namespaces_are_judged_as_rclpy_judges_them(name):
    # A node takes a relative namespace and puts the slash in front.
    absolute = name if name.startswith("/") else f"/{name}"
    assert accepts(check_namespace, name) == accepts(validate_namespace, absolute)


@pytest.mark.parametrize("length", [247, 248])
def test_a_topic_name_is_as_long_as_rclpy_allows(length):
    name = "/" + "x" * (length - 1)
    assert accepts(check_topic_name, name) == accepts(validate_full_topic_name, name)


@pytest.mark.parametrize("name", ["a", "/a", "~/a", "a/b"])
@pytest.mark.parametrize("namespace", ["", "/", "/r", "r", "/r/s"])
def test_names_expand_as_in_rclpy(name, namespace):
    absolute = namespace if namespace.startswith("/") else f"/{namespace}"
    assert expand(name, node="relay", namespace=namespace) == expand_topic_name(name, "relay", absolute)


def test_the_presets_are_those_of_rclpy():
    # `unknown` is what the graph shows for a policy that it does not tell; nobody can ask for it.
    names = {*qos.QoSPresetProfiles.short_keys(), "services_default"} - {"unknown"}
    assert set(get_args(PresetName)) == names
    assert all(qos.QoSPresetProfiles.get_from_short_key(name) for name in names)


@pytest.mark.parametrize(
    ("key", "policies"),
    [
        ("history", qos.QoSHistoryPolicy),
        ("reliability", qos.QoSReliabilityPolicy),
        ("durability", qos.QoSDurabilityPolicy),
        ("liveliness", qos.QoSLivelinessPolicy),
    ],
)
def test_the_values_of_a_qos_policy_are_those_of_rclpy(key, policies):
    words = set(get_args(get_args(QosOverrides.model_fields[key].annotation)[0]))
    assert words == set(policies.short_keys()) - {"unknown"}
