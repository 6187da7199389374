import random

import pytest

from syncrelay.config.names import (
    check_group_name,
    check_output_prefix,
    check_topic_name,
    default_output,
)
from syncrelay.config.sections import NodeConfig


def accepts(check, name):
    try:
        return check(name) == name
    except ValueError:
        return False


@pytest.mark.parametrize("name", ["front", "_front2", "F"])
def test_a_group_name_is_one_part_of_a_topic_name(name):
    assert accepts(check_group_name, name)


@pytest.mark.parametrize("name", ["", "2nd", "a/b", "a b", "front-left", "é", "${A}"])
def test_what_is_no_part_of_a_topic_name_is_no_group_name(name):
    assert not accepts(check_group_name, name)


@pytest.mark.parametrize("prefix", ["", "/", "~", "/a", "a", "~/a"])
def test_a_prefix_may_be_empty_a_name_or_what_a_name_begins_with(prefix):
    assert accepts(check_output_prefix, prefix)
    assert accepts(check_topic_name, default_output("/b", group="front", prefix=prefix))


def test_two_robots_with_one_file_publish_on_the_same_topics_only_where_they_receive_on_the_same():
    drawn = shared = 0
    for seed in range(500):
        chance = random.Random(seed)
        names = [chance.choice(("", "/", "~/")) + chance.choice("abc") for _ in range(3)]
        nodes = [NodeConfig(name="relay", namespace=robot) for robot in ("/robot1", "/robot2")]
        for topic in names:
            group = chance.choice(("front", "rear"))
            output = default_output(topic, group=group, prefix=None)
            inputs, outputs = ({node.absolute(name) for node in nodes} for name in (topic, output))
            assert len(inputs) == len(outputs), (seed, topic, output)
            drawn, shared = drawn + 1, shared + (len(inputs) == 1)
    assert drawn == 1500
    assert 300 < shared < 700
