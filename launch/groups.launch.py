"""Start a relay for each group of a file: `ros2 launch syncrelay groups.launch.py config:=fusion.yaml`.

Each is a process of its own, so it can use a core of its own, and takes no other group with it when it ends. The node
of group `front` is called `syncrelay_front`. Everything else is an argument of relay.launch.py.
"""

import re
from pathlib import Path

import yaml
from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration

_RELAY = str(Path(__file__).with_name("relay.launch.py"))


def generate_launch_description() -> LaunchDescription:
    return LaunchDescription(
        [
            DeclareLaunchArgument("config", description="the YAML file that describes the groups"),
            OpaqueFunction(function=_relays),
        ]
    )


def _relays(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    config = LaunchConfiguration("config").perform(context)
    given = [{"config": config, "group": group, "node_name": f"syncrelay_{group}"} for group in _groups(config)]
    return [
        IncludeLaunchDescription(PythonLaunchDescriptionSource(_RELAY), launch_arguments=arguments.items())
        for arguments in given
    ]


def _groups(config: str) -> list[str]:
    """Return the names of a file's groups. Raises RuntimeError if it has none, or one HTTP port for several."""
    # The relays check the file. Their own reader cannot be used: `ros2 launch` runs on the system's Python, which lacks
    # what a venv brought. The base loader takes keys as they are written, as that reader does.
    with Path(config).open(encoding="utf-8") as file:
        read = yaml.load(file, Loader=yaml.BaseLoader)  # noqa: S506  it makes texts, lists and dictionaries only
    groups = read.get("groups") if isinstance(read, dict) else None
    if not isinstance(groups, dict) or not groups:
        raise RuntimeError(f"{config}: no groups found, try `ros2 run syncrelay syncrelay validate {config}`")
    metrics = read.get("metrics")
    listen = str(metrics.get("listen")) if isinstance(metrics, dict) else ""
    if len(groups) > 1 and re.search(r":[1-9]\d*$", listen):
        raise RuntimeError(
            f"{config}: metrics.listen names one port for {len(groups)} processes: leave it out, so that each takes the"
            " first free one from 9464, or write `metrics: null`"
        )
    return list(groups)
