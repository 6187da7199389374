"""The image of docker/Dockerfile.ros, unchanged, on a base that stands in for ROS 2's own (tests/container/ros)."""

import pytest

from syncrelay.sync.compiled import source_fingerprint
from tests.container.docker import HARDENED, ON_ROS, PROBED_EVERY_SECOND, docker
from tests.container.stages import CONFIG, assert_relayed

pytestmark = pytest.mark.container

_SOURCES = """
import os, rclpy, pydantic
print(os.environ["AMENT_PREFIX_PATH"], rclpy.__file__.startswith("/opt/ros/jazzy/"), os.environ.get("SOURCED"))
print(pydantic.__file__.startswith("/opt/syncrelay/"))
"""


def test_a_relay_on_a_sourced_ros_is_healthy_relays_and_ends_in_order(relays, host):
    relays.image = ON_ROS
    relay = relays.run(CONFIG, "--network=host", *HARDENED, *PROBED_EVERY_SECOND)
    relay.wait_for_health("healthy")
    assert_relayed(host)
    relay.wait_for_log("messages pass through librcl")
    docker("kill", "--signal=TERM", relay.id)
    assert relay.exit_code() == 0


def test_a_file_is_valid_there_by_the_types_of_the_sourced_ros(relays):
    relays.image = ON_ROS
    relay = relays.run(CONFIG, "--network=none", arguments=("validate", "/config/fusion.yaml"))
    assert relay.exit_code() == 0
    assert relay.logs() == "/config/fusion.yaml: ok, 1 group, 2 topics\n"


def test_ros_comes_from_its_base_what_syncrelay_needs_from_the_image_and_an_overlay_is_sourced(tmp_path):
    (tmp_path / "local_setup.bash").write_text("export SOURCED=overlay\n")
    (tmp_path / "syncrelay").write_text(f"#!/opt/syncrelay/bin/python\n{_SOURCES}")
    (tmp_path / "syncrelay").chmod(0o755)
    tmp_path.chmod(0o755)
    said = docker(
        *("run", "--rm", "--network=none", f"--volume={tmp_path}:/overlay:ro"),
        f"--volume={tmp_path}/syncrelay:/opt/syncrelay/bin/syncrelay:ro",
        ON_ROS,
    )
    assert said.splitlines() == ["/opt/ros/jazzy True overlay", "True"]


def test_the_compiled_path_is_in_the_ros_image_and_its_compiler_is_not():
    said = docker(
        *("run", "--rm", "--network=none", "--entrypoint=sh", ON_ROS, "-c"),
        "python3 -c 'import syncrelay.ros.compiled.path as path; print(path.SOURCE)'; command -v gcc || true",
    )
    assert said == source_fingerprint()


def test_the_user_of_the_ros_image_is_not_root():
    assert docker("run", "--rm", "--network=none", "--entrypoint=id", ON_ROS, "-u") == "1000"
