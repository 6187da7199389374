"""An image with message packages of the user's own, built as docker/messages/README.md says."""

from pathlib import Path

import pytest

from tests.container.docker import WITH_MESSAGES, docker, run_docker
from tests.container.stages import assert_relayed
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import LOSSLESS, config, inputs

pytestmark = pytest.mark.container

_ROOT = Path(__file__).parents[2]
_FORCE = "rig_base_msgs/msg/Force"
_TOPICS = {"/gripper": _FORCE, "/camera": VECTOR}
_ROUND_TRIP = """
from rclpy.serialization import deserialize_message, serialize_message
from rig_base_msgs.msg import Force
from rig_msgs.msg import GripperState
state = GripperState(tool="claw", fingers=[Force(), Force()], offset=[1.0, 2.0, 3.0])
state.fingers[1].force.z = -1.5
again = deserialize_message(serialize_message(state), GripperState)
assert again == state
print(again.state == GripperState.CLOSED, again.fingers[1].force.z, again.offset.tolist())
"""

_HASHES = """
import json, os, sys
from pathlib import Path
from build_messages import _generate
os.environ["AMENT_PREFIX_PATH"] = sys.prefix
same = 0
for package in ("diagnostic_msgs", "stereo_msgs"):
    folder, output = Path(sys.prefix, "share", package), Path("/generated", package)
    messages = [file.relative_to(folder) for file in sorted(folder.glob("msg/*.msg"))]
    _generate(package, folder, messages, output)
    for message in messages:
        ours, theirs = (json.loads((place / message.with_suffix(".json")).read_text()) for place in (output, folder))
        assert ours["type_hashes"][0] == theirs["type_hashes"][0], message
        same += 1
print("the same", same)
"""


def _in_image(*words: str, entry: str) -> str:
    return docker("run", "--rm", "--network=none", f"--entrypoint={entry}", WITH_MESSAGES, *words)


def test_a_type_of_our_own_is_relayed(relays, containers):
    relays.image = containers.image = WITH_MESSAGES
    relays.run(config({"front": {"policy": "exact_time", "topics": inputs(_TOPICS, qos=LOSSLESS)}}), "--network=host")
    assert_relayed(containers, _TOPICS)


def test_messages_that_use_each_other_survive_a_round_trip():
    assert _in_image("-c", _ROUND_TRIP, entry="python3") == "True -1.5 [1.0, 2.0, 3.0]"


def test_a_wrong_type_is_compared_with_those_of_our_own(tmp_path):
    tmp_path.chmod(0o755)
    topics = inputs({"/gripper": "rig_base_msgs/msg/Forse", "/camera": VECTOR})
    (tmp_path / "fusion.yaml").write_text(config({"front": {"policy": "exact_time", "topics": topics}}))
    run = run_docker(
        "run", "--rm", "--network=none", f"--volume={tmp_path}:/config:ro", WITH_MESSAGES, "validate", "fusion.yaml"
    )
    assert run.returncode == 1
    assert f"did you mean `{_FORCE}`?" in run.stderr


def test_the_compiler_stays_out_of_the_image():
    assert _in_image("-c", "command -v gcc g++ || true", entry="sh") == ""


def test_what_is_generated_has_the_type_hashes_that_ros_gave_the_same_files(tmp_path):
    # Peers with another type hash do not connect.
    tmp_path.chmod(0o777)
    said = docker(
        *("run", "--rm", "--network=none", "--user=0", "--entrypoint=python3", "--env=PYTHONPATH=/docker"),
        f"--volume={_ROOT}/docker:/docker:ro",
        f"--volume={tmp_path}:/generated",
        *(WITH_MESSAGES, "-c", _HASHES),
    )
    assert said.splitlines()[-1] == "the same 4"
