"""Bundles in what a replay writes: what rosbags serializes of the same sets, and readable by their own definition."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from syncrelay.config import load_text
from syncrelay.errors import BagError
from syncrelay.recordings.fleet.task import what_decides_outputs, what_decides_sets
from tests.cli.command import run_here
from tests.config.ament import write_index
from tests.recordings.bag.making import rig, rig_file, write_mcap
from tests.recordings.bag.test_writing import payloads, write
from tests.ros.cdr_messages import STORE, VECTOR, stamp_of
from tests.ros.configs import inputs
from tests.ros.manifests import read

_SET = "rig_msgs/msg/Set"
_TEXT = """\
uint8[] marks [1, 2, 128]
byte kind 128
string word "a # b"
geometry_msgs/Vector3Stamped camera
float64[2] pair
uint64 number
geometry_msgs/Vector3Stamped lidar
string[] missing
rig_msgs/Turn turn
builtin_interfaces/Time[] stamps
bool[] flags [true, false]
std_msgs/Header header
"""
_TURN = "float64 w 1\nint16 n -3\n"
_VECTOR = "std_msgs/Header header\ngeometry_msgs/Vector3 vector\n"
_DEFINITIONS = {
    "builtin_interfaces/msg/Time": "int32 sec\nuint32 nanosec\n",
    "std_msgs/msg/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "geometry_msgs/msg/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
    VECTOR: _VECTOR,
    _SET: _TEXT,
    "rig_msgs/msg/Turn": _TURN,
}
_RIG = rig(10)
_MANIFEST = "/syncrelay/front/sets"
_BUNDLE = {"bundle": {"topic": "/set", "type": _SET}}


@pytest.fixture(autouse=True)
def definitions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All types that are installed, wherever the tests run."""
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(write_index(tmp_path / "ament", _DEFINITIONS)))


def _store() -> Any:
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(_TURN, "rig_msgs/msg/Turn") | get_types_from_msg(_TEXT, _SET))
    return store


def _expected(number: int, camera: bytes, lidar: bytes | None) -> bytes:
    store = _store()
    types = store.types
    time, zero = types["builtin_interfaces/msg/Time"], types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
    empty = types[VECTOR](types["std_msgs/msg/Header"](time(0, 0), ""), zero)
    stamps = [stamp_of(camera), stamp_of(lidar) if lidar else 0]
    whole = types[_SET](
        np.array([1, 2, 128], "uint8"),
        128 - 256,
        "a # b",
        store.deserialize_cdr(camera, VECTOR),
        np.zeros(2),
        number,
        store.deserialize_cdr(lidar, VECTOR) if lidar else empty,
        [] if lidar else ["lidar"],
        types["rig_msgs/msg/Turn"](1.0, -3),
        [time(*divmod(stamp, 10**9)) for stamp in stamps],
        np.array([True, False]),
        types["std_msgs/msg/Header"](time(*divmod(max(stamps), 10**9)), ""),
    )
    return bytes(store.serialize_cdr(whole, _SET))


def test_sets_are_written_as_bundles_alone_or_beside_the_outputs(tmp_path):
    bag = write_mcap(tmp_path / "rig.mcap", _RIG)
    plain = write(bag, tmp_path / "plain.mcap")
    pairs = list(zip(payloads(plain, "/front/camera"), payloads(plain, "/front/lidar"), strict=True))
    expected = [_expected(number, *pair) for number, pair in enumerate(pairs, 1)]
    beside = write(bag, tmp_path / "beside.mcap", **_BUNDLE)
    assert payloads(beside, "/set") == expected
    assert [each for each in beside if each.topic != "/set"] == plain
    told = [read(each) for each in payloads(write(bag, tmp_path / "told.mcap", **_BUNDLE, manifest=True), _MANIFEST)]
    assert [(each.bundle, each.bundle_sequence) for each in told] == [("/set", str(each.number)) for each in told]
    assert {one.output for each in told for one in each.inputs} == {"/front/camera", "/front/lidar"}
    alone = write(bag, tmp_path / "alone.mcap", **_BUNDLE, outputs=False, manifest=True)
    assert payloads(alone, "/set") == expected
    assert {each.topic for each in alone} == {"/set", _MANIFEST}
    for number, payload in enumerate(payloads(alone, _MANIFEST), 1):
        assert [(each.output, each.sequence) for each in read(payload).inputs] == [("/set", number)] * 2


def test_the_recorded_definition_is_that_of_the_type(tmp_path):
    write(write_mcap(tmp_path / "rig.mcap", _RIG), tmp_path / "out", **_BUNDLE)
    with Reader(tmp_path / "out") as reader:
        (connection,) = (each for each in reader.connections if each.topic == "/set")
        assert connection.digest == _store().hash_rihs01(_SET)
        found = get_typestore(Stores.EMPTY)
        types = get_types_from_msg(connection.msgdef.data, _SET)
        found.register({name: fields for name, fields in types.items() if name not in found.fielddefs})
        assert found.hash_rihs01(_SET) == connection.digest


def test_an_optional_input_that_is_missing_is_named(tmp_path):
    frames = [each for each in _RIG if each.topic == "/camera"]
    topics = [*inputs({"/camera": VECTOR}), *inputs({"/lidar": VECTOR}, required=False)]
    keys = {"max_wait": "1ms", "topics": topics}
    written = write(write_mcap(tmp_path / "rig.mcap", frames), tmp_path / "out.mcap", **_BUNDLE, outputs=False, **keys)
    cameras = [each.payload for each in frames]
    assert [each.payload for each in written] == [_expected(n, each, None) for n, each in enumerate(cameras, 1)]


def test_a_common_stamp_is_in_the_bundle_as_on_the_outputs(tmp_path):
    bag = write_mcap(tmp_path / "rig.mcap", _RIG)
    written = write(bag, tmp_path / "out.mcap", **_BUNDLE, restamp="earliest")
    store = _store()
    rows = zip(
        payloads(written, "/set"), payloads(written, "/front/camera"), payloads(written, "/front/lidar"), strict=True
    )
    for payload, camera, lidar in rows:
        found = store.deserialize_cdr(payload, _SET)
        assert found.camera == store.deserialize_cdr(camera, VECTOR)
        assert found.lidar == store.deserialize_cdr(lidar, VECTOR)
        assert found.header.stamp == found.camera.header.stamp


def test_a_type_that_is_not_installed_is_left_out(tmp_path):
    write_mcap(tmp_path / "rig.mcap", _RIG)
    (tmp_path / "rig.yaml").write_text(rig_file(bundle={"topic": "/set", "type": "other_msgs/msg/Set"}))
    done = run_here("replay", "rig.mcap", "--config", "rig.yaml", "-o", "out.mcap", folder=tmp_path)
    said = "front: its bundles are left out: other_msgs/msg/Set is not installed here, or not sourced"
    assert (done.returncode, said in done.stderr) == (0, True)
    with Reader(tmp_path / "out.mcap") as reader:
        assert {each.topic for each in reader.connections} == {"/front/camera", "/front/lidar", "/syncrelay/front/sets"}


def test_messages_of_another_definition_are_refused_with_both(tmp_path, monkeypatch):
    other = {**_DEFINITIONS, VECTOR: _VECTOR + "uint8 more\n"}
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(write_index(tmp_path / "other", other)))
    bag = write_mcap(tmp_path / "rig.mcap", _RIG)
    with pytest.raises(BagError) as refused:
        write(bag, tmp_path / "out.mcap", **_BUNDLE)
    assert str(refused.value).startswith(
        f"/camera is recorded with another definition of {VECTOR} than {_SET} has here:"
        f" {STORE.hash_rihs01(VECTOR)}, here RIHS01_"
    )


def test_a_type_with_wide_strings_is_refused(tmp_path, monkeypatch):
    wide = {**_DEFINITIONS, _SET: f"{_TEXT}wstring note\n"}
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(write_index(tmp_path / "wide", wide)))
    with pytest.raises(BagError, match=r"^front: wstring has no plain layout$"):
        write(write_mcap(tmp_path / "rig.mcap", _RIG), tmp_path / "out.mcap", **_BUNDLE)


def test_bundles_decide_what_a_replay_writes_and_not_which_sets_there_are():
    plain, beside, alone = (load_text(rig_file(**keys)).groups for keys in ({}, _BUNDLE, {**_BUNDLE, "outputs": False}))
    assert what_decides_sets(plain) == what_decides_sets(beside) == what_decides_sets(alone)
    assert len({what_decides_outputs(each) for each in (plain, beside, alone)}) == 3
