"""`syncrelay export`: the sets of a replay as Parquet, in a folder that says what it holds."""

import json
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType

from syncrelay.cli.demo import shipped_config
from syncrelay.recordings.datasets import read_sets
from tests.cli.command import run, run_python
from tests.recordings.bag.making import rig, write_mcap
from tests.recordings.datasets.times import rows_of
from tests.ros.cdr_messages import IMAGE, STORE, header, serialize
from tests.ros.frames import Frame

PAIR = """
version: 1
groups:
  front:
    policy: approximate_time
    slop: 20ms
    topics: [{topic: /camera}, {topic: /lidar}]
"""


@pytest.fixture(scope="module")
def rigged(tmp_path_factory):
    """The demo's recording and file, exported."""
    folder = tmp_path_factory.mktemp("export")
    (folder / "demo.yaml").write_text(shipped_config())
    run("demo", "--record", "rig.mcap", "--seconds", "3", folder=folder)
    done = run("export", "rig.mcap", "--config", "demo.yaml", "-o", "out", folder=folder)
    assert (done.returncode, done.stdout) == (0, "out: 1 recording: 1 done\n")
    return folder


def pictures() -> list[Frame]:
    """Colours of a camera, beside depths of 16 bits."""
    encodings = {"/camera": ("rgb8", 3), "/lidar": ("16UC1", 2)}
    frames = []
    for number in range(5):
        for topic, (encoding, size) in encodings.items():
            stamp = 10**18 + number * 10**8
            payload = serialize(IMAGE, header(stamp), 2, 4, encoding, 0, 4 * size, np.zeros(8 * size, np.uint8))
            frames.append(Frame(topic, IMAGE, stamp, payload))
    return frames


def exported(folder: Path, group: str):
    (path,) = folder.glob(f"out/*/{group}.parquet")
    return pq.ParquetFile(path)


@pytest.mark.parametrize("group", ["camera_lidar", "lidar_imu"])
def test_the_rows_are_the_sets_that_replay_prints(rigged, group):
    lines = run("replay", "rig.mcap", "--config", "demo.yaml", "--json", folder=rigged).stdout.splitlines()
    told = [line for line in map(json.loads, lines) if line["group"] == group]
    rows = rows_of(exported(rigged, group).read(["stamps", "left_at", "span_ns", "latency_ns"]))
    assert [(row["stamps"], row["left_at"], row["span_ns"], row["latency_ns"]) for row in rows] == [
        (line["stamps"], line["time"], line["span"], line["latency"]) for line in told
    ]
    assert len(rows) > 20


def test_the_file_is_the_table_that_programs_read(rigged):
    (batch,) = read_sets(rigged / "rig.mcap", rigged / "demo.yaml", group="lidar_imu")
    table = exported(rigged, "lidar_imu").read()
    drop = ["recording"]
    assert table.drop_columns(drop).equals(pa.Table.from_batches([batch]).drop_columns(drop))
    assert table.schema.field("/demo/imu/data").metadata == {b"type": b"sensor_msgs/msg/Imu", b"frame_id": b"imu"}


def test_it_is_written_for_those_who_read_parts_of_it(rigged):
    file = exported(rigged, "camera_lidar")
    group = file.metadata.row_group(0)
    columns = {group.column(index).path_in_schema: group.column(index) for index in range(group.num_columns)}
    assert columns["set"].has_column_index
    assert columns["set"].has_offset_index
    assert columns["/demo/camera/image_raw.data"].compression == "ZSTD"
    assert not columns["/demo/camera/image_raw.data"].is_stats_set
    assert max(file.metadata.row_group(index).total_byte_size for index in range(file.num_row_groups)) < 50_000_000


def test_each_input_may_have_a_picture_format_of_its_own_and_pictures_are_not_compressed_again(tmp_path):
    write_mcap(tmp_path / "bag.mcap", pictures())
    (tmp_path / "pair.yaml").write_text(PAIR)
    words = ["export", "bag.mcap", "--config", "pair.yaml", "--images", "jpeg", "--images", "/lidar=png", "-o", "out"]
    assert run(*words, folder=tmp_path).returncode == 0
    file = exported(tmp_path, "front")
    (row, *_) = rows_of(file.read())
    assert (row["/camera"]["data"][:2], row["/lidar"]["data"][:4]) == (b"\xff\xd8", b"\x89PNG")
    group = file.metadata.row_group(0)
    columns = {group.column(index).path_in_schema: group.column(index) for index in range(group.num_columns)}
    assert columns["/camera.data"].compression == columns["/lidar.data"].compression == "UNCOMPRESSED"


def test_fields_and_raw_bytes_are_chosen_on_the_command_line(rigged, tmp_path):
    fields = ["--fields", "/demo/imu/data:angular_velocity, header.stamp", "--fields", "/demo/lidar/points:width"]
    words = ["export", "rig.mcap", "--config", "demo.yaml", "--group", "lidar_imu"]
    run(*words, *fields, "-o", str(tmp_path / "fields/out"), folder=rigged)
    run(*words, "--raw", "-o", str(tmp_path / "raw/out"), folder=rigged)
    row = rows_of(exported(tmp_path / "fields", "lidar_imu").read())[0]
    assert row["/demo/imu/data"].keys() == {"header", "angular_velocity"}
    assert row["/demo/lidar/points"].keys() == {"width"}
    with (rigged / "rig.mcap").open("rb") as file:
        recorded = {message.data for _, _, message in make_reader(file).iter_messages(["/demo/imu/data"])}
    raw = exported(tmp_path / "raw", "lidar_imu").read(["/demo/imu/data"])["/demo/imu/data"].to_pylist()
    assert set(raw) <= recorded


def test_mcap_is_what_replay_writes(rigged, tmp_path):
    run("replay", "rig.mcap", "--config", "demo.yaml", "-o", str(tmp_path / "sets.mcap"), folder=rigged)
    done = run(
        "export", "rig.mcap", "--config", "demo.yaml", "--format", "mcap", "-o", str(tmp_path / "out"), folder=rigged
    )
    assert done.returncode == 0
    (written,) = tmp_path.glob("out/*/*.mcap")
    assert written.read_bytes() == (tmp_path / "sets.mcap").read_bytes()


@pytest.mark.parametrize(
    ("how", "chunk", "column"), [("zstd", "zstd", "ZSTD"), ("lz4", "lz4", "LZ4"), ("none", "", "UNCOMPRESSED")]
)
def test_what_is_written_is_packed_as_asked(how, chunk, column, rigged, tmp_path):
    words = ["rig.mcap", "--config", "demo.yaml", "--compression", how]
    assert run("replay", *words, "-o", str(tmp_path / "sets.mcap"), folder=rigged).returncode == 0
    with (tmp_path / "sets.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    assert {each.compression for each in summary.chunk_indexes} == {chunk}
    assert run("export", *words, "-o", str(tmp_path / "out"), folder=rigged).returncode == 0
    group = exported(tmp_path, "camera_lidar").metadata.row_group(0)
    assert {group.column(index).compression for index in range(group.num_columns)} == {column}


def test_a_group_without_sets_has_a_file_without_rows(tmp_path):
    write_mcap(tmp_path / "bag.mcap", [frame for frame in rig() if frame.topic == "/camera"])
    (tmp_path / "pair.yaml").write_text(PAIR)
    done = run("export", "bag.mcap", "--config", "pair.yaml", "-o", "out", folder=tmp_path)
    assert done.returncode == 1
    assert "front: /lidar is not in the recording" in done.stderr
    table = exported(tmp_path, "front").read()
    assert (len(table), table["/camera"].type.num_fields) == (0, 2)


def test_messages_that_cannot_be_decoded_are_told(tmp_path):
    frames = [
        frame._replace(payload=frame.payload[:-9]) if frame.topic == "/lidar" and index % 20 == 0 else frame
        for index, frame in enumerate(rig())
    ]
    write_mcap(tmp_path / "bag.mcap", frames)
    (tmp_path / "pair.yaml").write_text(PAIR)
    done = run("export", "bag.mcap", "--config", "pair.yaml", "-o", "out", folder=tmp_path)
    assert done.returncode == 1
    told = "messages could not be decoded as geometry_msgs/msg/Vector3Stamped, their cells are null"
    assert f"/lidar: 4 {told}" in done.stderr
    assert exported(tmp_path, "front").read()["/lidar"].null_count == 4


def test_memory_does_not_grow_with_the_recording(tmp_path):
    image = STORE.types["sensor_msgs/msg/Image"]
    empty = np.zeros(4_000_000, np.uint8)

    def frame(topic: str, number: int) -> Frame:
        stamp = 10**18 + number * 10**8
        made = image(header(stamp), 1000, 4000, "mono8", 0, 4000, empty)
        return Frame(topic, "sensor_msgs/msg/Image", stamp, bytes(STORE.serialize_cdr(made, "sensor_msgs/msg/Image")))

    frames = (frame(topic, number) for number in range(60) for topic in ("/camera", "/lidar"))
    write_mcap(tmp_path / "bag.mcap", frames, compression=CompressionType.ZSTD, chunk_size=1_000_000)
    (tmp_path / "pair.yaml").write_text(PAIR)
    script = (
        "import resource, subprocess, sys; done = subprocess.run(sys.argv[1:]);"
        " print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss); sys.exit(done.returncode)"
    )
    command = [sys.executable, "-m", "syncrelay", "export", "bag.mcap", "--config", "pair.yaml", "-o", "out"]
    done = run_python("-c", script, *command, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert exported(tmp_path, "front").metadata.num_rows == 60
    # 480 MB of messages; the programs and what they import take 150 MB of it.
    assert int(done.stdout.split()[-1]) < 400_000
