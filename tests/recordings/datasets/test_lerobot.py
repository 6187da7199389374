"""Recordings as a LeRobotDataset: its files, its frames against the messages, and what is refused."""

import json
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import av
import numpy as np
import pyarrow.parquet as pq
import pytest

from syncrelay.errors import BagError
from syncrelay.recordings.datasets.lerobot import layout
from syncrelay.recordings.datasets.lerobot.grid import Grid
from syncrelay.recordings.datasets.lerobot.sets import INCOMPLETE, NO_IMAGE, NOT_FINITE
from syncrelay.recordings.datasets.lerobot.stats import PictureStats, stats_of, together
from syncrelay.recordings.datasets.lerobot.videos import VideoWriter
from tests.faults.extent import chosen
from tests.recordings.datasets.drives import (
    INPUTS,
    JOINTS,
    command,
    compressed,
    config,
    drive,
    image,
    joints,
    picture,
    task,
    written,
)

FRONT, WRIST = "observation.images.front", "observation.images.wrist"
FIRST, SECOND = range(0, 2000, 100), range(50, 950, 100)
NS = 10**9
# What a lossy video may change of slow shades on average; pictures of two stamps are farther apart.
CLOSE = 2.5


def table(folder: Path, kind="data", file=0):
    return pq.read_table(folder / f"dataset/{kind}/chunk-000/file-{file:03d}.parquet")


def frames(folder: Path, key=FRONT, file=0):
    """Times and pixels of a video's frames."""
    with av.open(str(folder / f"dataset/videos/{key}/chunk-000/file-{file:03d}.mp4")) as video:
        return [(frame.time, frame.to_ndarray(format="rgb24").astype(int)) for frame in video.decode(video=0)]


def about(folder: Path, name="info"):
    return json.loads((folder / f"dataset/meta/{name}.json").read_text())


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    """A folder with the dataset of two recordings, and its facts."""
    folder = tmp_path_factory.mktemp("two")
    return folder, written(folder, drive(folder / "a.mcap", FIRST), drive(folder / "b.mcap", SECOND))


def test_a_dataset_has_the_files_that_its_readers_look_for(two):
    folder, facts = two
    files = [path.relative_to(folder / "dataset") for path in (folder / "dataset").rglob("*") if path.is_file()]
    assert sorted(map(str, files)) == [
        "data/chunk-000/file-000.parquet",
        "meta/episodes/chunk-000/file-000.parquet",
        "meta/info.json",
        "meta/stats.json",
        "meta/tasks.parquet",
        f"videos/{FRONT}/chunk-000/file-000.mp4",
        f"videos/{WRIST}/chunk-000/file-000.mp4",
    ]
    assert {key: each for key, each in facts.items() if key != "episodes"} == {
        "total_episodes": 2,
        "total_frames": 29,
        "total_tasks": 1,
        "held": 0,
        "left_out": 0,
        "problems": [],
    }
    info = about(folder)
    assert (info["codebase_version"], info["fps"], info["splits"]) == ("v3.0", 10, {"train": "0:2"})
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (2, 29, 1)
    features = info["features"]
    assert list(features)[:4] == [FRONT, WRIST, "observation.state", "action"]
    assert list(features)[4:] == ["timestamp", "frame_index", "episode_index", "index", "task_index"]
    assert features[FRONT]["shape"] == [48, 64, 3]
    assert features[FRONT]["info"]["video.codec"] == "h264"
    assert features["observation.state"] == {
        "dtype": "float32",
        "shape": [4],
        "names": [*(f"{joint}.position" for joint in JOINTS), "twist.angular.z"],
    }
    assert features["action"]["names"] == ["twist.linear.x", "twist.linear.y", "twist.linear.z"]


def test_every_frame_has_the_values_of_its_messages(two):
    rows = table(two[0]).to_pylist()
    for number, (row, stamp) in enumerate(zip(rows, [*FIRST, *SECOND], strict=True)):
        state = np.array([stamp / 1000, stamp / 1000 + 1, stamp / 1000 + 2, -stamp / 7], np.float32)
        assert row["observation.state"] == state.tolist()
        assert row["action"] == np.array([stamp / 100, -1, 0.5], np.float32).tolist()
        episode, frame = (0, number) if number < 20 else (1, number - 20)
        keys = ("index", "episode_index", "frame_index", "task_index")
        assert [row[key] for key in keys] == [number, episode, frame, 0]
        assert row["timestamp"] == np.float32(frame / 10)


@pytest.mark.parametrize(("key", "ahead"), [(FRONT, 0), (WRIST, 350)])
def test_frame_n_of_the_video_is_frame_n_of_the_data(two, key, ahead):
    shown = frames(two[0], key)
    assert [time for time, _ in shown] == pytest.approx([number / 10 for number in range(29)])
    for (_, pixels), stamp in zip(shown, [*FIRST, *SECOND], strict=True):
        assert np.abs(pixels - picture(stamp + ahead)).mean() < CLOSE


def test_every_second_frame_can_be_jumped_to_and_none_waits_for_a_later_one(two):
    with av.open(str(two[0] / f"dataset/videos/{FRONT}/chunk-000/file-000.mp4")) as video:
        packets = [packet for packet in video.demux(video=0) if packet.dts is not None]
        assert all(one.is_keyframe or other.is_keyframe for one, other in pairwise(packets))
        assert all(packet.pts == packet.dts for packet in packets)
        assert video.streams.video[0].average_rate == Fraction(10)
        assert video.streams.video[0].pix_fmt == "yuv420p"


def test_episodes_say_where_their_frames_and_videos_are(two):
    first, second = table(two[0], "meta/episodes").to_pylist()
    assert (first["dataset_from_index"], first["dataset_to_index"], first["length"]) == (0, 20, 20)
    assert (second["dataset_from_index"], second["dataset_to_index"], second["length"]) == (20, 29, 9)
    assert (second["episode_index"], second["tasks"]) == (1, ["pick up the cube"])
    assert [each[f"videos/{FRONT}/from_timestamp"] for each in (first, second)] == [0.0, 2.0]
    assert [each[f"videos/{FRONT}/to_timestamp"] for each in (first, second)] == [2.0, 2.9]
    assert second["stats/action/count"] == [9]
    assert second["stats/action/max"] == pytest.approx([8.5, -1.0, 0.5])
    assert pq.ParquetFile(two[0] / "dataset/data/chunk-000/file-000.parquet").num_row_groups == 2


def test_files_of_a_kind_are_of_bounded_size(tmp_path, monkeypatch):
    # The size of one recording's, in the unit of megabytes.
    monkeypatch.setattr(layout, "MOST_MB", {"data": 0.002, "episodes": 100, "video": 0.004})
    bags = [drive(tmp_path / f"{name}.mcap") for name in "abc"]
    written(tmp_path, *bags)
    rows = table(tmp_path, "meta/episodes").to_pylist()
    assert [row["data/file_index"] for row in rows] == [0, 1, 2]
    assert [row[f"videos/{FRONT}/file_index"] for row in rows] == [0, 1, 2]
    assert [row[f"videos/{FRONT}/from_timestamp"] for row in rows] == [0.0, 0.0, 0.0]
    assert table(tmp_path, file=2)["index"].to_pylist() == list(range(40, 60))
    assert len(frames(tmp_path, file=1)) == 20


def test_statistics_are_those_of_the_frames(two):
    rows = np.array(table(two[0])["observation.state"].to_pylist())
    stats = about(two[0], "stats")
    found = stats["observation.state"]
    assert found["count"] == [29]
    pixels = np.array([picture(stamp) for stamp in [*FIRST, *SECOND]]) / 255
    for what in ("mean", "std", "min", "max"):
        assert found[what] == pytest.approx(getattr(rows, what)(axis=0)), what
        of_colours = getattr(pixels, what)(axis=(0, 1, 2)).reshape(3, 1, 1)
        assert np.array(stats[FRONT][what]) == pytest.approx(of_colours), what
    assert stats["frame_index"]["max"] == [19]
    assert stats["timestamp"]["q50"] == pytest.approx([(0.95 * 20 + 0.4 * 9) / 29])


def test_large_pictures_are_looked_at_in_steps_and_held_ones_count_as_often_as_they_are_shown():
    large = np.zeros((600, 900, 3), np.uint8)
    large[::6, ::6] = 255
    stats = PictureStats()
    stats.add(large, 3)
    stats.add(np.zeros_like(large), 1)
    found = stats.stats()
    assert found["count"] == [4]
    assert found["mean"].reshape(3) == pytest.approx([0.75] * 3)
    assert (found["q10"].reshape(3)[0], found["q50"].reshape(3)[0]) == (0, 1)


def test_statistics_of_parts_together_are_those_of_the_whole():
    rows = np.random.default_rng(3).normal(5, 3, (300, 2))
    joined = together(stats_of(rows[:40]), stats_of(rows[40:]))
    whole = stats_of(rows)
    for what in ("min", "max", "mean", "std", "count"):
        assert joined[what] == pytest.approx(whole[what]), what


def test_the_same_recordings_give_the_same_bytes(two, tmp_path):
    folder, _ = two
    written(tmp_path, folder / "a.mcap", folder / "b.mcap")
    one, other = (
        {path.relative_to(root): path.read_bytes() for path in (root / "dataset").rglob("*") if path.is_file()}
        for root in (folder, tmp_path)
    )
    assert one == other


@pytest.mark.faults
def test_a_video_has_the_same_bytes_each_time(tmp_path):
    pictures = [np.full((48, 64, 3), (9 * each, 200 - 5 * each, 3 * each), np.uint8) for each in range(20)]
    contents = set()
    # Where x264 builds macroblock trees, one of fifty or so differs.
    for number in range(chosen(short=60, long=2000)):
        with VideoWriter(tmp_path / f"{number}.mp4", fps=30) as video:
            for each in pictures:
                video.add(each, 1)
        contents.add((tmp_path / f"{number}.mp4").read_bytes())
    assert len(contents) == 1


@pytest.mark.parametrize("fps", [1, 7, 10, 30, 1000])
def test_frames_stand_at_fixed_distances_and_show_what_is_nearest(fps):
    random = np.random.default_rng(fps)
    stamps = np.cumsum(random.integers(1, 2 * NS // fps, 100)).tolist()
    grid = Grid(fps=fps, max_gap_ns=NS * 10)
    counts = [*[grid.next_set(stamp) for stamp in stamps][1:], grid.end()]
    shown = [stamp for stamp, count in zip(stamps, counts, strict=True) for _ in range(count)]
    times = [stamps[0] + Fraction(number * NS, fps) for number in range(grid.frames)]
    assert shown == [min(stamps, key=lambda stamp: (abs(stamp - time), stamp)) for time in times]
    assert 0 <= stamps[-1] + Fraction(NS, 2 * fps) - times[-1] < Fraction(NS, fps)
    assert grid.left_out == counts.count(0)
    assert grid.held == sum(count - 1 for count in counts if count)
    farthest = max(abs(stamp - time) for stamp, time in zip(shown, times, strict=True))
    assert grid.farthest_ns == pytest.approx(farthest, abs=1)


def test_a_gap_ends_it_and_a_longer_one_can_be_allowed(tmp_path):
    bag = drive(tmp_path / "a.mcap", [0, 100, 200, 801, 900])
    with pytest.raises(BagError, match=r"a\.mcap: no set for 0.601 s after 0.2 s, expected 0.5 s at most: cut"):
        written(tmp_path, bag)
    (tmp_path / "again").mkdir()
    more = "task: pick\n    max_gap: 700ms"
    assert written(tmp_path / "again", bag, loaded=config(more=more))["total_frames"] == 10


def test_an_episode_with_other_features_than_the_first_is_left_out_and_told(tmp_path):
    names = ("pan", "lift", "thumb")
    other = {("/joints", stamp): joints(stamp, names=names) for stamp in range(0, 2000, 100)}
    facts = written(tmp_path, drive(tmp_path / "a.mcap"), drive(tmp_path / "b.mcap", instead=other))
    assert facts["total_episodes"] == 1
    (problem,) = facts["problems"]
    found, expected = (f"pan.position, lift.position, {each}.position, twist.angular.z" for each in ("thumb", "grip"))
    assert problem == f"b: observation.state has {found}, expected {expected}, as in a: it is left out"


@pytest.mark.parametrize(
    ("instead", "why"),
    [
        ({("/wrist", 500): compressed(500, data=b"no picture")}, NO_IMAGE),
        ({("/wrist", 500): compressed(500, data=b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 64 48\n")}, NO_IMAGE),
        ({("/wrist", 500): compressed(500, data=b"")}, NO_IMAGE),
        ({("/camera", 500): image(500)[:-900]}, INCOMPLETE),
        ({("/joints", 500): joints(500, values=(0, float("nan"), 0))}, NOT_FINITE),
        ({("/cmd", 500): command(500, x=1e300)}, NOT_FINITE),
    ],
)
def test_a_set_that_lacks_something_is_no_frame_and_the_nearest_one_is_shown(tmp_path, instead, why):
    facts = written(tmp_path, drive(tmp_path / "a.mcap", instead=instead))["episodes"]["a"]
    assert facts["unusable"] == {why: 1}
    assert (facts["frames"], facts["held"]) == (20, 1)
    assert [row[0] for row in table(tmp_path)["action"].to_pylist()][4:7] == pytest.approx([4, 4, 6])


def test_joints_keep_their_places_whatever_their_order(tmp_path):
    instead = {
        ("/joints", 300): joints(300, names=("grip", "pan", "lift"), values=(2.3, 0.3, 1.3)),
        ("/joints", 400): joints(400, names=()),
    }
    written(tmp_path, drive(tmp_path / "a.mcap", instead=instead))
    rows = table(tmp_path)["observation.state"].to_pylist()
    assert [row[:3] for row in rows] == [pytest.approx([n / 10, n / 10 + 1, n / 10 + 2]) for n in range(20)]


def test_a_topic_tells_the_task_of_each_frame(tmp_path):
    inputs = INPUTS + "      - {topic: /task, type: std_msgs/msg/String, stamp: receive}\n"
    group = "latest_time\n    trigger: /camera"
    words = {
        ("/task", stamp): task(stamp, words="close it") if stamp == 700 else None for stamp in range(100, 2000, 100)
    }
    stamps = range(0, 2000, 100)
    topics = ("/task", "/wrist", "/joints", "/cmd", "/camera")
    bag = drive(tmp_path / "a.mcap", stamps, topics=topics, instead=words)
    loaded = config(inputs=inputs, group=group, more="task: {topic: /task, field: data}", fps=5)
    written(tmp_path, bag, drive(tmp_path / "b.mcap", topics=topics), loaded=loaded)
    episodes = table(tmp_path, "meta/episodes").to_pylist()
    assert [each["tasks"] for each in episodes] == [["open the door", "close it"], ["open the door"]]
    tasks = pq.read_table(tmp_path / "dataset/meta/tasks.parquet").to_pylist()
    assert tasks == [{"task_index": 0, "task": "open the door"}, {"task_index": 1, "task": "close it"}]
    found = table(tmp_path)["task_index"].to_pylist()
    assert found[: episodes[0]["length"]] == sorted(found[: episodes[0]["length"]])
    assert set(found) == {0, 1}


def test_a_vector_of_one_value_is_a_number_and_no_video_is_no_fault(tmp_path):
    features = "\n      action: /cmd:twist.linear.x\n      observation.state: [/joints:position, /joints:position]\n"
    written(tmp_path, drive(tmp_path / "a.mcap"), loaded=config(features=features))
    assert table(tmp_path)["action"].to_pylist() == pytest.approx([n * 1.0 for n in range(20)])
    info = about(tmp_path)
    assert info["video_path"] is None
    assert info["features"]["action"]["shape"] == [1]
    assert info["features"]["observation.state"]["names"][:2] == ["joints.pan.position", "joints.lift.position"]


SIZED = np.zeros((32, 64, 3), np.uint8)


@pytest.mark.parametrize(
    ("instead", "told"),
    [
        (
            {("/joints", 300): joints(300, names=("pan", "lift"), values=(1, 2))},
            "/joints:position has 3 values in one message and 2 in another: every frame needs as many",
        ),
        (
            {("/joints", 300): joints(300, names=("pan", "lift", "thumb"))},
            "/joints:position is of pan, lift, thumb in one message and of pan, lift, grip in another",
        ),
        (
            {("/joints", stamp): joints(stamp, names=(), values=()) for stamp in range(0, 2000, 100)},
            "/joints:position has no values, expected one or more in every message",
        ),
        ({("/camera", 300): image(300, pixels=SIZED)}, "/camera has images of 64 x 48 and of 64 x 32: a video has one"),
        ({("/camera", 0): image(0, pixels=SIZED[:31])}, "images of 64 x 31 cannot become video, expected even numbers"),
        (
            {("/camera", 0): image(0, encoding="mono16", pixels=np.zeros((48, 64), "<u2"))},
            "/camera: images of encoding 'mono16' have 16 bits a pixel, a video holds 8",
        ),
        (
            {("/camera", 0): image(0, encoding="bayer_rggb8", pixels=np.zeros((48, 64), "u1"))},
            "encoding 'bayer_rggb8' have no colours yet: debayer them first",
        ),
        (
            {("/cmd", stamp): command(stamp, x=float("inf")) for stamp in range(0, 2000, 100)},
            "none of 20 sets can be a frame: 20 with a value that is no finite number",
        ),
        ({("/camera", stamp): image(stamp + 5) for stamp in range(0, 2000, 100)}, "because of policy exact_time"),
    ],
)
def test_what_no_episode_can_be_is_said(tmp_path, instead, told):
    with pytest.raises(BagError) as raised:
        written(tmp_path, drive(tmp_path / "a.mcap", instead=instead))
    assert told in str(raised.value)


@pytest.mark.parametrize(
    ("features", "told"),
    [
        ("action: /cmd:twist.lineer", "/cmd: geometry_msgs/msg/Twist has no field `lineer`, did you mean `linear`?"),
        ("action: /cmd:header", "/cmd:header is string, expected numbers"),
        ("action: /camera:data", "/camera:data is binary, expected numbers"),
        ("action: /joints:position.x", "/joints"),
        (
            "{action: /joints:position, observation.images.a: /cmd}",
            "/cmd is geometry_msgs/msg/TwistStamped, expected sensor_msgs/msg/Image or",
        ),
    ],
)
def test_what_the_recorded_types_do_not_have_is_said(tmp_path, features, told):
    inputs = "\n".join(line.partition(", type")[0] + "}" for line in INPUTS.strip("\n").splitlines())
    features = features if features.startswith("{") else f"\n      {features}\n"
    loaded = config(inputs=f"\n{inputs}\n", features=f" {features}\n" if features.startswith("{") else features)
    with pytest.raises(BagError) as raised:
        written(tmp_path, drive(tmp_path / "a.mcap"), loaded=loaded)
    assert told in str(raised.value)


def test_stamps_that_fall_are_no_run_of_time():
    grid = Grid(fps=10, max_gap_ns=NS)
    for stamp in (5 * NS, 5 * NS, 5 * NS + NS // 2):
        grid.next_set(stamp)
    with pytest.raises(BagError, match=r"stamps of sets fall by 2.5 s after 0.5 s: an episode is one run of time"):
        grid.next_set(3 * NS)
