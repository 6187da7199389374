"""What the relay's node tells of itself as parameters."""

import pytest

rclpy = pytest.importorskip("rclpy", reason="rclpy is not installed")
Parameters = pytest.importorskip("syncrelay.ros.parameters").Parameters

pytestmark = pytest.mark.ros


def test_the_groups_of_a_managed_node_come_and_go(ros_domain: int):
    context = rclpy.context.Context()
    rclpy.init(context=context, domain_id=ros_domain, args=["--ros-args", "--disable-external-lib-logs"])
    node = rclpy.create_node("here", context=context)
    try:
        parameters = Parameters(node, paths=["fusion.yaml"], version="1")
        for groups in ([], ["front"], [], ["front", "rear"], [], ["rear"]):
            parameters.name_groups(groups)
            assert node.get_parameter("groups").value == groups
    finally:
        node.destroy_node()
        context.try_shutdown()
