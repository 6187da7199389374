"""Parameters of the relay's node: those that it declares, and keys of the file that have no effect there."""

import random

import pytest

from syncrelay.config.file import file_format

own_node = pytest.importorskip("tests.ros.in_process", reason="rclpy is not installed").own_node
parameters = pytest.importorskip("syncrelay.ros.parameters")
misplaced = parameters.misplaced

# What launch files give every node, or a node of somebody else has.
_OF_OTHERS = ("robot_description", "frame_id", "camera.fps_limit", "camera.slop", "start_type_description_service")


def test_a_key_of_the_file_is_named_once_and_a_parameter_of_another_node_never():
    form = file_format()
    of_group, of_topic = (list(model.model_fields) for model in (form.any_group, form.any_topic))
    for seed in range(300):
        chance = random.Random(seed)
        keys = chance.sample(of_group, chance.randint(0, 3)) + chance.sample(of_topic, chance.randint(0, 2))
        written = {chance.choice(("", "groups.front.", "defaults.")) + key for key in keys}
        others = chance.sample(_OF_OTHERS, 3)
        names = [*written, *others]
        chance.shuffle(names)
        said = misplaced(names)
        assert (said is None) == (not written), seed
        assert [name for name in names if f"`{name}`" in (said or "")] == [name for name in names if name in written]
        assert all((said or "").count(f"`{name}`") == 1 for name in written), (seed, said)


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (
            ["slop", "queue_size", "listen"],
            "`slop` and `queue_size` belong in the file, in a group; `listen` belongs in the file, in `metrics`",
        ),
        (["groups"], "`groups` belongs in the file"),
        (["config"], "`config` belongs behind `--config`"),
        (
            ["qos_overrides./camera.subscription.depth"],
            "`qos_overrides./camera.subscription.depth` belongs in the file, as the `qos` of a topic",
        ),
    ],
)
def test_it_says_where_a_parameter_belongs(names, said):
    assert misplaced(names) == f"these are not set by ROS parameters: {said}"


@pytest.mark.ros
def test_the_groups_of_a_managed_node_come_and_go(ros_domain: int):
    with own_node(ros_domain) as own:
        declared = parameters.Parameters(own.node, paths=["fusion.yaml"], version="1")
        for groups in ([], ["front"], [], ["front", "rear"], [], ["rear"]):
            declared.name_groups(groups)
            assert own.node.get_parameter("groups").value == groups
