"""Real recordings as datasets, with the file that `init` proposes: the sets of a replay, every message decoded."""

from collections import defaultdict
from contextlib import closing
from itertools import chain

import pytest

from syncrelay.config import load_text
from syncrelay.recordings.analysis import propose
from syncrelay.recordings.bag import open_recording
from syncrelay.recordings.bag.bindings import bind
from syncrelay.recordings.bag.definitions import converter, typestore
from syncrelay.recordings.bag.recording import Encoding
from syncrelay.recordings.bag.replay import Replay, received
from syncrelay.recordings.datasets.decoding import Decoder
from syncrelay.recordings.datasets.message_types import arrow_type
from syncrelay.recordings.datasets.reading import SetsOf
from syncrelay.recordings.datasets.tables import Content
from syncrelay.sync import Match
from tests.recordings.bag.reading import one_by_one
from tests.recordings.datasets.reference_decoder import decode
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


_OTHERS = ["event_camera_mcap/test_events_2", "ouster_packets/512x10_raw.bag", "raspicam_fiducials/aruco_images.bag"]
_MOST = 50
"""So many messages of a topic are decoded slowly."""


@pytest.mark.parametrize("name", [*_RECORDINGS, *_OTHERS])
def test_every_topic_is_decoded_as_a_slow_decoder_does(name, real_data):
    payloads = defaultdict(list)
    with closing(open_recording([str(real_data / name)])) as recording:
        for channel, _, payload in chain.from_iterable(recording.batches(recording.channels)):
            cdr = payload if channel.encoding is Encoding.CDR else converter(channel)(payload)
            assert cdr is not None, channel.topic
            payloads[channel].append(cdr)
    assert payloads
    for channel, found in payloads.items():
        store = typestore(channel.type, channel.definition)
        if store is None:
            assert channel.definition is None, channel.type
            continue
        arrow = arrow_type(store, channel.type)
        decoder = Decoder(arrow, arrow)
        column = decoder.decode(found)
        assert (len(column), decoder.undecodable) == (len(found), 0), channel.topic
        step = len(found) // _MOST + 1
        rows = [row.as_py() for row in column[::step]]
        assert repr(rows) == repr([decode(store, channel.type, each) for each in found[::step]]), channel.topic


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
        for _ in Replay(recording, bind(config, recording), listeners=[one_by_one(note)]).steps():
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
    assert rows
    assert min(map(len, rows.values())) > 90
    assert sets.faults() == []
