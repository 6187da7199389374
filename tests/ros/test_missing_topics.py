"""What is missing is said, once, and nothing else waits for it."""

import signal

import pytest

from tests.ros import relaying
from tests.ros.cdr_messages import IMAGE, VECTOR
from tests.ros.configs import LOSSLESS, config, inputs
from tests.ros.stage import Stage
from tests.ros.streams import at, merged

pytestmark = pytest.mark.ros


def _exact(*topics: str) -> dict:
    return {"policy": "exact_time", "topics": inputs(dict.fromkeys(topics, VECTOR), qos=LOSSLESS)}


def test_an_absent_publisher_is_named_once_and_the_group_runs_when_it_comes(stage: Stage):
    relay = stage.relay(config({"front": _exact("/camera", "/lidar")}))
    camera = stage.player({"/camera": VECTOR})
    camera.match()
    relay.wait_for_log("front: waiting for a publisher of /lidar")
    # A message that comes and goes while another is missing is no reason to say it again.
    camera.play(at("/camera", *range(0, 3000, 100)), speed=1)
    lidar = stage.player({"/lidar": VECTOR})
    lidar.match()
    relay.wait_for_log("front: running")
    relay.send(signal.SIGTERM)
    assert relay.wait() == 0
    waits = [line for line in relay.stderr.splitlines() if "waiting for a publisher of /lidar" in line]
    assert len(waits) == 1


def test_a_publisher_of_another_type_is_named_and_does_not_disturb(stage: Stage):
    stage.player({"/camera": IMAGE})
    text = config({"front": _exact("/camera", "/lidar")})
    recording = merged(at("/camera", 0, 10, 20), at("/lidar", 0, 10, 20))
    aligned = {"/front/camera": VECTOR, "/front/lidar": VECTOR}
    relay, collector = relaying.relay(stage, text, recording, aligned)
    expected = [(frame.payload, frame.payload) for frame in at("/camera", 0, 10, 20)]
    assert relaying.sets_within(recording, collector, aligned) == expected
    relay.wait_until(
        lambda: any(
            all(word in line for word in ("/camera", "/player", IMAGE, VECTOR)) for line in relay.stderr.splitlines()
        ),
        "a line that names the publisher, its type and the file's",
    )


def test_a_type_that_is_not_installed_is_named_once_and_other_groups_run(stage: Stage):
    broken = _exact("/camera", "/absent")
    broken["topics"][1]["type"] = "acme_msgs/msg/Thing"
    text = config({"front": _exact("/camera", "/lidar"), "rear": broken})
    recording = merged(at("/camera", 0, 10, 20), at("/lidar", 0, 10, 20))
    aligned = {"/front/camera": VECTOR, "/front/lidar": VECTOR}
    relay, collector = relaying.relay(stage, text, recording, aligned)
    expected = [(frame.payload, frame.payload) for frame in at("/camera", 0, 10, 20)]
    assert relaying.sets_within(recording, collector, aligned) == expected
    relay.wait_for_log("rear: waiting for the type acme_msgs/msg/Thing")
    # What explains the silence of its group is said beside it.
    errors = [line for line in relay.said if line.startswith("[ERROR]")]
    assert sum("/absent: acme_msgs/msg/Thing" in line for line in errors) == 1
