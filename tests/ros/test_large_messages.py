"""Messages larger than what Fast DDS's shared memory holds by default."""

import numpy as np
import pytest

from syncrelay.environment.transport import LARGE_MESSAGES, PROFILES, apply_transport
from tests.ros import relaying
from tests.ros.cdr_messages import IMAGE, header, serialize
from tests.ros.configs import LOSSLESS, config, inputs, outputs
from tests.ros.frames import Frame
from tests.ros.stage import Stage
from tests.ros.streams import BEGIN, MS

_SEGMENT_BYTES = 64 << 20
_IMAGE_BYTES = 2_000_000


def test_the_file_can_ask_for_large_messages():
    environ: dict[str, str] = {}
    apply_transport("large_messages", environ)
    assert environ == dict.fromkeys(PROFILES, str(LARGE_MESSAGES))
    untouched: dict[str, str] = {}
    apply_transport("default", untouched)
    assert untouched == {}


@pytest.mark.parametrize("variable", [*PROFILES, "FASTDDS_BUILTIN_TRANSPORTS"])
def test_what_the_environment_names_stands(variable, caplog):
    environ = {variable: "mine"}
    apply_transport("large_messages", environ)
    assert environ == {variable: "mine"}
    assert f"`transport: large_messages` has no effect: the environment has {variable}=mine" in caplog.text


@pytest.mark.ros
def test_large_images_pass_through_the_shared_memory_that_the_file_asks_for(stage: Stage):
    topics = {"/left": IMAGE, "/right": IMAGE}
    aligned = dict.fromkeys(outputs("stereo", topics), IMAGE)
    recording = [
        Frame(topic, IMAGE, BEGIN + n * 50 * MS, _image(BEGIN + n * 50 * MS, fill=n))
        for n in range(10)
        for topic in topics
    ]
    group = {"policy": "exact_time", "topics": inputs(topics, qos=LOSSLESS)}
    relay = stage.relay(config({"stereo": group}, node={"transport": "large_messages"}))
    # The others have it from their environment, as any process may.
    stage.environment.update(dict.fromkeys(PROFILES, str(LARGE_MESSAGES)))
    collector = stage.collector(aligned)
    player = stage.player(topics)
    relaying.connect(player, collector, recording, aligned)
    player.play(recording, speed=1)
    relaying.conclude(player, collector, recording, aligned)
    received = relaying.sets_within(recording, collector, aligned)
    assert received == [(frame.payload, frame.payload) for frame in recording[::2]]
    assert max(path.stat().st_size for path in relay.shared_memory()) >= _SEGMENT_BYTES


def _image(stamp: int, *, fill: int) -> bytes:
    pixels = np.full(_IMAGE_BYTES, fill, dtype=np.uint8)
    return serialize(IMAGE, header(stamp), 1, _IMAGE_BYTES, "mono8", 0, _IMAGE_BYTES, pixels)
