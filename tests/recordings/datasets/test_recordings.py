"""Real recordings as datasets, with the file that `init` proposes: the sets of a replay, every message decoded."""

from contextlib import closing

import pytest

from syncrelay.config import load_text
from syncrelay.recordings.analysis import propose
from syncrelay.recordings.bag import open_recording
from syncrelay.recordings.bag.bindings import bind
from syncrelay.recordings.bag.replay import Replay, received
from syncrelay.recordings.datasets.reading import SetsOf
from syncrelay.recordings.datasets.tables import Content
from syncrelay.sync import Match
from tests.recordings.datasets.times import rows_of

pytestmark = pytest.mark.real_data

# Those of more than one topic with stamps. The others have nothing to match: an event camera alone, packets.
_RECORDINGS = [
    "gps_odom_uf_rosbag2/bag",
    "husky_jackal_robot_localization/test1.bag",
    "multicam_tagslam/test_2.tag_detections.bag.bz2",
    "multicam_tagslam/test_14.tag_detections.bag.bz2",
    "multicam_tagslam/test_21.tag_detections.bag.bz2",
    "vehicle_mtig_sick_tilt_laser/tilt_laser.bag",
]


@pytest.mark.parametrize("name", _RECORDINGS)
def test_every_set_is_a_row_and_every_message_is_decoded(name, real_data):
    with closing(open_recording([str(real_data / name)])) as recording:
        config = load_text(propose(recording).text, environ={})
    told: dict[str, list[tuple[object, ...]]] = {group.name: [] for group in config.groups}

    def note(binding, outcome, now):
        if isinstance(outcome, Match):
            last = max(received(each) for each in outcome.messages if each is not None)
            told[binding.group.name].append((outcome.stamps, now, now - last))

    with closing(open_recording([str(real_data / name)])) as recording:
        for _ in Replay(recording, bind(config, recording), listeners=[note]).steps():
            pass
    rows: dict[str, list[tuple[object, ...]]] = {group.name: [] for group in config.groups}
    with closing(open_recording([str(real_data / name)])) as recording:
        bindings = bind(config, recording)
        sets = SetsOf(bindings, Content(), name=name)
        steps = Replay(recording, bindings, listeners=sets.listeners).steps()
        for group, table in sets.parts(steps, most_bytes=100_000):
            inputs = [each.topic for each in group.binding.inputs]
            stamps = table["stamps"].combine_chunks()
            for topic in inputs:
                assert table[topic].combine_chunks().is_null().equals(stamps.field(topic).is_null())
            rows[group.binding.group.name] += [
                (tuple(row["stamps"].values()), row["left_at"], row["latency_ns"])
                for row in rows_of(table.select(["stamps", "left_at", "latency_ns"]))
            ]
    assert rows == told
    assert sum(map(len, rows.values()))
    assert sets.faults() == []
