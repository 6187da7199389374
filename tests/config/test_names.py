import pytest

from syncrelay.config.names import (
    check_group_name,
    check_output_prefix,
    check_topic_name,
    default_output,
)


def accepts(check, name):
    try:
        return check(name) == name
    except ValueError:
        return False


@pytest.mark.parametrize("name", ["/a", "a", "~/a", "/a/b_2/_c", "a/b", "A", "x" * 247])
def test_what_ros_accepts_is_a_topic_name(name):
    assert accepts(check_topic_name, name)


@pytest.mark.parametrize(
    "name", ["", "/", "~", "~a", "a~", "//a", "a//b", "a/", "1a", "a/1", "a-b", "a b", "é", "{ns}/a", "a\n", "x" * 248]
)
def test_what_ros_refuses_is_no_topic_name(name):
    assert not accepts(check_topic_name, name)


@pytest.mark.parametrize("name", ["front", "_front2", "F"])
def test_a_group_name_is_one_part_of_a_topic_name(name):
    assert accepts(check_group_name, name)


@pytest.mark.parametrize("name", ["", "2nd", "a/b", "a b", "front-left", "é", "${A}"])
def test_what_is_no_part_of_a_topic_name_is_no_group_name(name):
    assert not accepts(check_group_name, name)


@pytest.mark.parametrize("prefix", ["", "/", "~", "/a", "a", "~/a"])
def test_a_prefix_may_be_empty_a_name_or_what_a_name_begins_with(prefix):
    assert accepts(check_output_prefix, prefix)
    assert accepts(check_topic_name, default_output("/b", prefix=prefix))


@pytest.mark.parametrize(
    ("topic", "prefix", "output"),
    [
        ("/b", "/a", "/a/b"),
        ("b", "/a", "/a/b"),
        ("~/b", "/a", "/a/b"),
        ("/b/c", "a", "a/b/c"),
        ("/b", "~", "~/b"),
        ("/b", "~/a", "~/a/b"),
        ("/b", "/", "/b"),
        ("b", "", "b"),
    ],
)
def test_a_default_output_is_the_prefix_and_the_name_of_the_input(topic, prefix, output):
    assert default_output(topic, prefix=prefix) == output
