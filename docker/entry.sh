#!/usr/bin/env bash
# Sources ROS 2 and, where one is mounted at /overlay, a workspace with message packages; then becomes syncrelay.
set -e
# shellcheck source=/dev/null
source "/opt/ros/${ROS_DISTRO:-jazzy}/setup.bash"
if [ -f /overlay/local_setup.bash ]; then
    # shellcheck source=/dev/null
    source /overlay/local_setup.bash
fi
exec syncrelay "$@"
