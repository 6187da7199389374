"""A small recording of which a relay, wherever it runs, must publish the sets that the engine finds."""

from syncrelay.sync import ExactTime
from tests.ros import relaying
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import LOSSLESS, config, inputs, outputs
from tests.ros.stage import Player, Stage
from tests.ros.streams import at, merged

PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
PAIR_OUT = dict.fromkeys(outputs("front", PAIR), VECTOR)
FRONT = {"policy": "exact_time", "topics": inputs(PAIR, qos=LOSSLESS)}
CONFIG = config({"front": FRONT})


def assert_relayed(stage: Stage, topics: dict[str, str] | None = None, group: str = "front") -> Player:
    """Play on this stage and assert that a relay elsewhere publishes exactly the 20 expected sets.

    Every type of the topics must have the fields of VECTOR. Returns the player, which still runs.
    """
    topics = topics or PAIR
    first, second = topics
    played = merged(at(first, *range(0, 1000, 25)), at(second, *range(0, 1000, 50)))
    recording = [frame._replace(type_name=topics[frame.topic]) for frame in played]
    aligned = dict(zip(outputs(group, topics), topics.values(), strict=True))
    collector = stage.collector(aligned)
    player = stage.player(topics)
    relaying.connect(player, collector, recording, aligned)
    player.play(recording)
    relaying.conclude(player, collector, recording, aligned)
    expected = relaying.expected_sets(ExactTime(n_inputs=2, queue_size=10), recording, list(topics))
    assert len(expected) == 20
    assert relaying.sets_within(recording, collector, aligned) == expected
    return player
