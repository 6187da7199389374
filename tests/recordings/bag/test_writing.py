"""What a replay writes is what the relay would publish, and others can read it."""

import random
from itertools import accumulate
from pathlib import Path

import pytest
import yaml
from mcap.records import Channel, Chunk, Message, MessageIndex
from mcap.stream_reader import StreamReader, breakup_chunk
from rosbags.interfaces import ConnectionExtRosbag2, QosDurability, QosReliability
from rosbags.rosbag2 import Reader, StoragePlugin

from syncrelay.config.profile import PRESETS, Profile
from syncrelay.errors import OutputError
from syncrelay.recordings.bag.definitions import jazzy_definition
from syncrelay.recordings.bag.mcap_output import McapOutput
from syncrelay.recordings.bag.qos import read_profiles, write_profile
from syncrelay.recordings.bag.replay import replay
from syncrelay.recordings.bag.writing import SetWriter
from tests.recordings.bag.making import BEST_EFFORT, rig, rig_file, write_mcap, write_ros1
from tests.recordings.bag.making import write_rosbag2 as write_folder
from tests.recordings.bag.reading import bound
from tests.ros.cdr_messages import STORE, VECTOR, stamp_of
from tests.ros.frames import Frame
from tests.ros.manifests import read

_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
_TOPICS = tuple(_PAIR)
_RIG = rig(10)


def write(bag: Path, output: Path, **keys) -> list[Frame]:
    """What a replay with a group of a camera and a lidar writes, as rosbags reads it."""
    with (
        bound(bag, text=rig_file(**{"manifest": False, **keys})) as (recording, bindings),
        McapOutput(output) as written,
    ):
        writer = SetWriter(written)
        for binding in bindings:
            writer.begin(binding)
        replay(recording, bindings, listeners=[writer.take])
    return _read(output)


def _read(output: Path) -> list[Frame]:
    with Reader(output) as reader:
        return [Frame(each.topic, each.msgtype, time, payload) for each, time, payload in reader.messages()]


def payloads(frames, topic):
    return [frame.payload for frame in frames if frame.topic == topic]


@pytest.mark.parametrize("output", ["out.mcap", "out"])
def test_payloads_are_written_unchanged_on_the_outputs(output, tmp_path):
    written = write(write_mcap(tmp_path / "rig.mcap", _RIG), tmp_path / output)
    for topic in _PAIR:
        assert payloads(written, f"/front{topic}") == payloads(_RIG, topic)[:-1]
    # A set leaves with the message that shows that no closer one can come.
    assert {frame.time for frame in written} <= {frame.time for frame in _RIG}


@pytest.mark.parametrize("output", ["out.mcap", "out"])
def test_types_and_qos_are_recorded(output, tmp_path):
    bag = write_folder(tmp_path / "rig", _RIG, qos=[BEST_EFFORT])
    write(bag, tmp_path / output)
    with Reader(tmp_path / output) as reader:
        assert reader.message_count == 18
        for connection in reader.connections:
            assert connection.msgtype == VECTOR
            assert "Vector3 vector" in connection.msgdef.data
            assert isinstance(connection.ext, ConnectionExtRosbag2)
            (qos,) = connection.ext.offered_qos_profiles
            assert (qos.reliability, qos.durability) == (QosReliability.BEST_EFFORT, QosDurability.VOLATILE)


def test_a_folder_has_the_metadata_of_rosbag2(tmp_path):
    written = write(write_mcap(tmp_path / "rig.mcap", _RIG, qos=[BEST_EFFORT]), tmp_path / "out")
    with Reader(tmp_path / "out") as reader:
        about = reader.connections[0].ext
        assert isinstance(about, ConnectionExtRosbag2)
        assert all(each.digest == STORE.hash_rihs01(VECTOR) for each in reader.connections)
    theirs = write_folder(tmp_path / "theirs", written, plugin=StoragePlugin.MCAP, qos=about.offered_qos_profiles)
    ours, of_rosbags = ((folder / "metadata.yaml").read_text() for folder in (tmp_path / "out", theirs))
    of_rosbags = of_rosbags.replace("theirs.mcap", "out_0.mcap").replace("ros_distro: rosbags", "ros_distro: jazzy")
    assert yaml.safe_load(ours) == yaml.safe_load(of_rosbags)


@pytest.mark.parametrize("restamp", ["none", "earliest"])
def test_messages_of_a_ros1_bag_are_written_as_ros2_has_them(restamp, tmp_path):
    from_ros1 = write(write_ros1(tmp_path / "rig.bag", _RIG), tmp_path / "one", restamp=restamp)
    from_ros2 = write(write_mcap(tmp_path / "rig.mcap", _RIG), tmp_path / "two", restamp=restamp)
    assert from_ros1 == from_ros2
    with Reader(tmp_path / "one") as reader:
        assert {each.msgdef.data for each in reader.connections} == {STORE.generate_msgdef(VECTOR, ros_version=2)[0]}
        assert {each.digest for each in reader.connections} == {STORE.hash_rihs01(VECTOR)}


def test_outputs_without_a_set_are_there_too(tmp_path):
    assert write(write_mcap(tmp_path / "rig.mcap", _RIG), tmp_path / "out", slop="1ms") == []
    with Reader(tmp_path / "out") as reader:
        assert {each.topic for each in reader.connections} == {"/front/camera", "/front/lidar"}
    about = yaml.safe_load((tmp_path / "out" / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert (about["duration"], about["message_count"]) == ({"nanoseconds": 0}, 0)


def test_a_manifest_is_written_behind_the_messages_of_its_set(tmp_path):
    written = write(write_mcap(tmp_path / "rig.mcap", _RIG), tmp_path / "out", manifest=True, restamp="earliest")
    sets = [written[at : at + 3] for at in range(0, len(written), 3)]
    assert len(sets) == 9
    for number, (camera, lidar, manifest) in enumerate(sets, 1):
        assert (manifest.topic, manifest.time) == ("/syncrelay/front/sets", camera.time)
        told = read(manifest.payload)
        assert (told.number, told.common_stamp) == (number, stamp_of(camera.payload))
        assert told.stamp == stamp_of(camera.payload) == stamp_of(lidar.payload)
        assert [(each.output, each.sequence, each.stamp) for each in told.inputs] == [
            ("/front/camera", number, told.stamp),
            ("/front/lidar", number, told.stamp),
        ]
        newest = max(each.received for each in told.inputs if each.received is not None)
        assert told.latency == manifest.time - newest
    with Reader(tmp_path / "out") as reader:
        (connection,) = (each for each in reader.connections if each.topic == "/syncrelay/front/sets")
        assert connection.digest == STORE.hash_rihs01(connection.msgtype)


def test_sets_of_a_clock_have_the_stamps_of_its_ticks(tmp_path):
    wait, bag = 60_000_000, write_mcap(tmp_path / "rig.mcap", rig(40))
    by_clock = {"policy": "latest_time", "slop": None, "trigger": "29.97 Hz", "max_wait": "60ms", "restamp": "trigger"}
    written = write(bag, tmp_path / "out", **by_clock)
    assert [stamp_of(frame.payload) for frame in written] == [frame.time - wait for frame in written]
    assert len(written) > 200


@pytest.mark.parametrize("key", [{"stamp": "receive"}, {"clock": "device"}])
def test_a_manifest_tells_the_stamps_that_messages_leave_with_whatever_they_are_matched_by(key, tmp_path):
    topics = [{"topic": topic, "type": VECTOR, **key} for topic in _PAIR]
    bag = write_mcap(tmp_path / "rig.mcap", _RIG)
    written = write(bag, tmp_path / "out", manifest=True, topics=topics, slop="50s")
    told = [read(payload) for payload in payloads(written, "/syncrelay/front/sets")]
    assert len(told) > 1
    for index, topic in enumerate(_PAIR):
        left = [stamp_of(payload) for payload in payloads(written, f"/front{topic}")]
        assert [each.inputs[index].stamp for each in told] == left
        assert left != [each.inputs[index].original_stamp for each in told]


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_messages_are_in_chunks_of_a_megabyte_with_an_index_each(compression, tmp_path):
    chance, definition, channels = random.Random(1), jazzy_definition(VECTOR), {}
    sizes = [*(chance.randrange(300_000) for _ in range(40)), 3_000_000, 0, 7]
    sent = [(chance.choice(_TOPICS), chance.randbytes(size) + bytes(size)) for size in sizes]
    with McapOutput(tmp_path / "out.mcap", compression=compression) as written:
        outputs = {topic: written.add(topic, VECTOR, *definition, Profile()) for topic in _TOPICS}
        for number, (topic, payload) in enumerate(sent):
            written.write(outputs[topic], payload, 1000 - number)
            assert written.count == number + 1
    chunks, found, indexed = [], [], 0
    with (tmp_path / "out.mcap").open("rb") as file:
        for record in StreamReader(file, emit_chunks=True).records:
            if isinstance(record, Channel):
                channels[record.id] = record.topic
            elif isinstance(record, Chunk):
                messages = [each for each in breakup_chunk(record, validate_crc=True) if isinstance(each, Message)]
                found += messages
                chunks.append([31 + len(each.data) for each in messages])
                places = list(zip(messages, accumulate(chunks[-1], initial=0), strict=False))
                assert record.message_start_time == messages[-1].log_time
                assert record.message_end_time == messages[0].log_time
            elif isinstance(record, MessageIndex):
                own = [(each.log_time, place) for each, place in places if each.channel_id == record.channel_id]
                assert record.records == own
                indexed += len(own)
    assert [(channels[each.channel_id], each.data) for each in found] == sent
    assert [each.log_time for each in found] == [1000 - number for number in range(len(sent))]
    for number in channels:
        of_channel = [each.sequence for each in found if each.channel_id == number]
        assert of_channel == list(range(len(of_channel)))
    # A chunk is full with the message that makes a megabyte of it.
    assert all(sum(each[:-1]) < 2**20 for each in chunks)
    assert all(sum(each) >= 2**20 for each in chunks[:-1])
    assert (indexed, len(chunks) > 8) == (len(sent), True)


def test_nothing_is_overwritten(tmp_path):
    bag = write_mcap(tmp_path / "rig.mcap", _RIG)
    with pytest.raises(OutputError, match=r"rig\.mcap: already exists and is not overwritten"):
        write(bag, bag)
    with pytest.raises(OutputError, match=r"cannot be written: .*none is not a folder"):
        write(bag, tmp_path / "none" / "out.mcap")


def test_profiles_are_read_from_every_version_of_the_metadata():
    numbers = "- {history: 3, depth: 0, reliability: 2, durability: 1, liveliness: 1, deadline: {sec: 1, nsec: 5}}"
    (profile,) = read_profiles(numbers)
    assert (profile.history, profile.reliability, profile.durability) == ("unknown", "best_effort", "transient_local")
    assert profile.deadline == 1_000_000_005
    assert read_profiles(yaml.safe_dump([write_profile(profile)])) == (profile,)
    assert [read_profiles(text) for text in ("", "x: [", "5")] == [(), (), ()]


_LAUGHS = "".join(f"- &l{n} [{', '.join([f'*l{n - 1}'] * 9) if n else 'lol'}]\n" for n in range(12))


_NO_PROFILES = {
    "nested": "[" * 5000,
    "nested maps": "- {a: " * 5000,
    "nested in a profile": "- {reliability: " + "[" * 5000 + "]" * 5000 + "}",
    "aliases": f"- {{reliability: reliable}}\n{_LAUGHS}",
    "no date": "- 2001-99-99",
    "no number": f"- {'9' * 5000}",
    "no key": "- {? [] : x}",
    "a tag": "- !!python/name:os.system",
    "no bool": "- depth: !!bool foo",
    "no float": "- depth: !!float ''",
    "a tag of a map": "- !!map {depth: 5}",
    "an endless float": "- depth: " + "1:" * 2000 + "1.5",
    "a time before all": "- 0001-01-01 00:00:00 +23:59",
    "more than any text": "- {depth: 5}\n" * 10_000,
    "no text": "\0",
}


@pytest.mark.parametrize("text", _NO_PROFILES.values(), ids=_NO_PROFILES)
def test_profiles_that_nobody_offers_are_none(text):
    assert read_profiles(text) == ()


def test_values_that_no_profile_has_are_unknown_or_unset():
    (profile,) = read_profiles(
        '- {reliability: [a, b], durability: "\\e[31m", history: 99, deadline: {sec: .inf, nsec: 0}}'
    )
    assert (profile.reliability, profile.durability, profile.history) == ("unknown",) * 3
    assert profile.deadline == 0


@pytest.mark.ros
def test_the_presets_are_those_of_rclpy():
    from rclpy.qos import QoSPresetProfiles  # noqa: PLC0415  where it is installed

    for name, ours in PRESETS.items():
        theirs = QoSPresetProfiles.get_from_short_key(name)
        for key in ("history", "reliability", "durability", "liveliness"):
            assert getattr(theirs, key).name.lower() == getattr(ours, key)
        for key in ("deadline", "lifespan", "liveliness_lease_duration"):
            assert getattr(theirs, key).nanoseconds == getattr(ours, key)
        assert theirs.depth == ours.depth
