"""Start the relay: `ros2 launch syncrelay relay.launch.py config:=fusion.yaml`."""

from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

# Time to read why it ended, and for others to forget the old node. Launch respawns whatever the exit code.
_RESPAWN_AFTER_S = 2.0


def generate_launch_description() -> LaunchDescription:
    return LaunchDescription(
        [
            DeclareLaunchArgument("config", description="the YAML file that describes the groups"),
            DeclareLaunchArgument("group", default_value="", description="run this group only; default: all"),
            DeclareLaunchArgument("node_name", default_value="", description="its name; default: as the file says"),
            DeclareLaunchArgument(
                "namespace",
                default_value="",
                description="of the node, its relative topics and their outputs; default: as the file says",
            ),
            DeclareLaunchArgument(
                "log_level",
                default_value="info",
                choices=["debug", "info", "warning", "error"],
                description="the least severe messages that the log shows",
            ),
            DeclareLaunchArgument(
                "use_sim_time",
                default_value="",
                choices=["", "true", "false"],
                description="wait and stamp by /clock; default: as the file says",
            ),
            DeclareLaunchArgument(
                "respawn",
                default_value="false",
                choices=["true", "false"],
                description=f"start it again {_RESPAWN_AFTER_S:g} s after it ends by itself",
            ),
            OpaqueFunction(function=_relay),
        ]
    )


def _relay(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    def given(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    group, sim_time = given("group"), given("use_sim_time")
    arguments = ["--config", given("config"), "--log-level", given("log_level")]
    return [
        Node(
            package="syncrelay",
            executable="syncrelay",
            # What is not given stays as the file says.
            name=given("node_name") or None,
            namespace=given("namespace") or None,
            arguments=[*arguments, "--group", group] if group else arguments,
            parameters=[{"use_sim_time": sim_time == "true"}] if sim_time else None,
            output="screen",
            # A line of the log appears when it is written.
            emulate_tty=True,
            respawn=given("respawn") == "true",
            respawn_delay=_RESPAWN_AFTER_S,
        )
    ]
