"""Sets as record batches: the sets of `replay`, with the messages that were recorded."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer
from PIL import Image
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from syncrelay.config import load_text
from syncrelay.errors import BagError, UsageError
from syncrelay.recordings.datasets import read_sets
from tests.recordings.bag.making import CUSTOM, rig, write_mcap, write_ros1, write_rosbag2
from tests.recordings.datasets import times
from tests.ros.cdr_messages import STORE, VECTOR
from tests.ros.streams import MS

GROUP = """
version: 1
groups:
  front:
    policy: approximate_time
    slop: 20ms
    {more}
    topics:
      - {{topic: /camera}}
      - {{topic: /lidar}}
"""


def config(more=""):
    return load_text(GROUP.format(more=more))


def rows_of(*args, **options):
    return [row for batch in read_sets(*args, **options) for row in times.rows_of(batch)]


def test_messages_leave_with_the_stamp_of_their_set(tmp_path):
    bag = write_mcap(tmp_path / "bag.mcap", rig())
    rows = rows_of(bag, config("restamp: earliest"))
    for row in rows:
        stamp = row["/camera"]["header"]["stamp"]
        assert stamp["sec"] * 10**9 + stamp["nanosec"] == row["stamp"] == min(row["stamps"].values())


def test_an_optional_input_that_was_not_recorded_has_the_type_of_the_file(tmp_path):
    bag = write_mcap(tmp_path / "bag.mcap", rig())
    loaded = load_text(
        GROUP.format(more="max_wait: 50ms") + "      - {topic: /imu, type: sensor_msgs/msg/Imu, required: false}\n"
    )
    (batch,) = read_sets(bag, loaded)
    assert batch["/imu"].null_count == len(batch) > 0
    assert batch.schema.field("/imu").type.field("angular_velocity").type.num_fields == 3


def test_all_sets_come_whatever_the_size_of_a_batch(tmp_path):
    # What is read at a time is some thousands of messages.
    bag = write_mcap(tmp_path / "bag.mcap", rig(5_000), chunk_size=50_000)
    whole = rows_of(bag, config())
    batches = list(read_sets(bag, config(), most_bytes=1))
    assert len(batches) > 3
    assert [row for batch in batches for row in times.rows_of(batch)] == whole
    assert len({batch.schema.serialize().to_pybytes() for batch in batches}) == 1


def test_a_type_that_the_recording_does_not_define_is_named_and_raw_takes_it(tmp_path):
    frames = [frame._replace(type_name="secret_msgs/msg/Thing") for frame in rig()]
    bag = _undefined(tmp_path / "bag.mcap", frames)
    with pytest.raises(BagError, match=r"does not define secret_msgs/msg/Thing.* use --raw"):
        next(read_sets(bag, config()))
    assert len(rows_of(bag, config(), raw=True)) > 30


def test_ros_1_messages_are_those_of_ros_2(tmp_path):
    bag = write_ros1(tmp_path / "bag.bag", rig())
    rows = rows_of(bag, config())
    assert rows[0]["/camera"]["header"].keys() == {"stamp", "frame_id"}
    stamps = [row["/camera"]["header"]["stamp"] for row in rows]
    assert [each["sec"] * 10**9 + each["nanosec"] for each in stamps] == [row["stamps"]["/camera"] for row in rows]


@pytest.mark.parametrize("image_format", ["png", "jpeg"])
@pytest.mark.parametrize(
    ("encoding", "shape"), [("rgb8", (3, 4, 3)), ("bgr8", (3, 4, 3)), ("mono8", (3, 4)), ("rgba8", (3, 4, 4))]
)
def test_images_are_pictures(tmp_path, image_format, encoding, shape):
    pixels = np.full(shape, 40, "u1")
    if len(shape) == 3:
        pixels[..., 0] = 200
        pixels[..., 3:] = 255
    bag = write_mcap(tmp_path / "bag.mcap", images(encoding, pixels))
    rows = rows_of(bag, config(), images=image_format)
    picture = rows[0]["/camera"]
    assert picture.keys() == {"header", "height", "width", "encoding", "format", "data"}
    assert (picture["format"], picture["encoding"], picture["height"]) == (image_format, encoding, 3)
    (tmp_path / "picture").write_bytes(picture["data"])
    found = np.asarray(Image.open(tmp_path / "picture").convert("RGB")).astype(int)
    expected = (200, 40, 40) if encoding in ("rgb8", "rgba8") else (40, 40, 200) if encoding == "bgr8" else (40,) * 3
    assert np.abs(found - expected).max() <= 3


@pytest.mark.parametrize("big_endian", [0, 1])
def test_depth_images_of_16_bits_are_whole_in_png(tmp_path, big_endian):
    pixels = (np.arange(12).reshape(3, 4) * 5000).astype(">u2" if big_endian else "<u2")
    bag = write_mcap(tmp_path / "bag.mcap", images("16UC1", pixels, big_endian=big_endian))
    (tmp_path / "picture").write_bytes(rows_of(bag, config(), images="png")[0]["/camera"]["data"])
    assert np.array_equal(np.asarray(Image.open(tmp_path / "picture")), pixels)
    with pytest.raises(BagError, match="JPEG cannot hold 16 bit images: use --images /camera=png"):
        rows_of(bag, config(), images="jpeg")


def test_an_image_that_is_too_long_for_jpeg_is_whole_in_png(tmp_path):
    bag = write_mcap(tmp_path / "bag.mcap", images("mono8", np.zeros((1, 65_501), "u1")))
    with pytest.raises(BagError, match=r"/camera: JPEG holds .* one has 65,501 x 1: use --images /camera=png"):
        rows_of(bag, config(), images="jpeg")
    assert rows_of(bag, config(), images="png")[0]["/camera"]["width"] == 65_501


def test_a_format_for_what_has_no_images_is_refused(tmp_path):
    bag = write_mcap(tmp_path / "bag.mcap", images("rgb8", np.zeros((3, 4, 3), "u1")))
    with pytest.raises(BagError, match=f"/lidar is {VECTOR}, expected sensor_msgs/msg/Image: --images does not go"):
        rows_of(bag, config(), images={"/lidar": "png"})
    with pytest.raises(UsageError, match="/lidr is no input of the file, did you mean `/lidar`"):
        rows_of(bag, config(), images={"/lidr": "png"})


def test_an_encoding_that_no_picture_holds_is_named(tmp_path):
    bag = write_mcap(tmp_path / "bag.mcap", images("32FC1", np.zeros((3, 4), "f4")))
    with pytest.raises(BagError, match="encoding '32FC1' cannot become PNG"):
        rows_of(bag, config(), images="png")


def test_an_image_that_is_smaller_than_it_says_is_null_and_told(tmp_path):
    frames = images("rgb8", np.zeros((3, 4, 3), "u1"), height=400)
    bag = write_mcap(tmp_path / "bag.mcap", frames)
    assert all(row["/camera"] is None and row["/lidar"] is not None for row in rows_of(bag, config(), images="png"))


def test_several_recordings_are_read_one_after_the_other_each_by_itself(tmp_path):
    first = write_mcap(tmp_path / "1.mcap", rig())
    second = write_rosbag2(tmp_path / "2", rig(20))
    rows = rows_of([first, second], config())
    assert rows[: len(rows_of(first, config()))] == rows_of(first, config())
    assert [row["set"] for row in rows if row["recording"] == str(second)] == list(
        range(1, len(rows_of(second, config())) + 1)
    )


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"group": "frnt"}, "no group frnt, did you mean `front`?; it has front"),
        ({"fields": {"/camra": ["vector.x"]}}, "/camra is no input of the file, did you mean `/camera`?"),
    ],
)
def test_words_that_mean_nothing_are_told(tmp_path, options, told):
    bag = write_mcap(tmp_path / "bag.mcap", rig())
    with pytest.raises(UsageError) as raised:
        next(read_sets(bag, config(), **options))
    assert told in str(raised.value)


def test_a_file_with_several_groups_wants_one_to_be_named(tmp_path):
    text = GROUP.format(more="")
    both = text + text.split("groups:\n")[1].replace("front", "rear")
    bag = write_mcap(tmp_path / "bag.mcap", rig())
    with pytest.raises(UsageError, match="the groups front and rear: say which one, as group='front'"):
        next(read_sets(bag, load_text(both)))
    assert rows_of(bag, load_text(both), group="rear") == rows_of(bag, config())


def images(encoding, pixels, *, big_endian=0, height=None, topics=("/camera",)):
    """Images of some topics, of a camera alone unless said otherwise, with a lidar beside it."""
    types = STORE.types
    frames = []
    for frame in rig(10):
        if frame.topic in topics:
            found: Any = STORE.deserialize_cdr(frame.payload, frame.type_name)
            image = types["sensor_msgs/msg/Image"](
                header=found.header,
                height=height or pixels.shape[0],
                width=pixels.shape[1],
                encoding=encoding,
                is_bigendian=big_endian,
                step=pixels.strides[0],
                data=np.frombuffer(pixels.tobytes(), np.uint8),
            )
            payload = bytes(STORE.serialize_cdr(image, "sensor_msgs/msg/Image"))
            frames.append(frame._replace(type_name="sensor_msgs/msg/Image", payload=payload))
        else:
            frames.append(frame)
    return frames


def _undefined(path: Path, frames):
    """An MCAP file whose schemas are empty."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        schema = writer.register_schema("secret_msgs/msg/Thing", "", b"")
        channels = {topic: writer.register_channel(topic, "cdr", schema) for topic in ("/camera", "/lidar")}
        for frame in frames:
            writer.add_message(channels[frame.topic], frame.time, frame.payload, frame.time)
        writer.finish()
    return path


def test_fields_that_two_definitions_of_a_type_share_are_read_from_both(tmp_path):
    path = tmp_path / "bag.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        channels = []
        for added in ("", "string added\n"):
            store = get_typestore(Stores.ROS2_JAZZY)
            store.register(get_types_from_msg(f"std_msgs/Header header\n{added}int64 number\n", CUSTOM))
            schema = writer.register_schema(CUSTOM, "ros2msg", store.generate_msgdef(CUSTOM, ros_version=2)[0].encode())
            channels.append((store, [writer.register_channel(topic, "cdr", schema) for topic in ("/camera", "/lidar")]))
        for n in range(10):
            store, topics = channels[n // 3 % 2]
            types = store.types
            header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](n + 1, 0), "rig")
            message = types[CUSTOM](header, *["text"] * (n // 3 % 2), n)
            for topic in topics:
                writer.add_message(topic, (n + 1) * 1000 * MS, bytes(store.serialize_cdr(message, CUSTOM)), 0)
        writer.finish()
    shared = ["header.frame_id", "number"]
    rows = rows_of(path, config(), fields={"/camera": shared, "/lidar": shared})
    assert [row["/camera"] for row in rows] == [{"header": {"frame_id": "rig"}, "number": n} for n in range(10)]
    assert [row["/lidar"] for row in rows] == [row["/camera"] for row in rows]
    with pytest.raises(BagError, match="two definitions of rig_msgs/msg/Blip: use --raw, or --fields with fields that"):
        rows_of(path, config())
    with pytest.raises(BagError, match="has no field `added`"):
        rows_of(path, config(), fields={"/camera": ["added"]})
