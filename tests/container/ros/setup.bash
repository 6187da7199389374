# What a ROS installation's own script sets, for the wheels' folders; their libraries are in one each.
prefix=/opt/ros/jazzy
packages=$(echo "$prefix"/lib/python3*/site-packages)
export AMENT_PREFIX_PATH=$prefix ROS_DISTRO=jazzy ROS_VERSION=2 ROS_PYTHON_VERSION=3
export PYTHONPATH=$packages${PYTHONPATH:+:$PYTHONPATH}
libraries=$prefix/lib
for folder in "$packages"/ros_*.libs; do
    libraries=$libraries:$folder
done
export LD_LIBRARY_PATH=$libraries${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}
