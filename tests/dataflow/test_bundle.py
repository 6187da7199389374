"""Bundles as flows publish them: on both paths alike, once a set, with all that is said of it."""

import struct
from types import SimpleNamespace

import pytest

from syncrelay.cdr_assembly import ENCAPSULATION
from syncrelay.config import load_text
from syncrelay.dataflow.backend import PublishError
from syncrelay.dataflow.bugs import Bugs
from syncrelay.dataflow.bundle import Bundle, BundleError
from syncrelay.dataflow.group import GroupRelay
from syncrelay.dataflow.manifest import ManifestWriter
from syncrelay.dataflow.manifest_queue import ManifestQueue
from tests.dataflow.payloads import FLOWS, Outlet, connect
from tests.ros.cdr_messages import VECTOR, vector
from tests.ros.configs import config, inputs
from tests.ros.manifests import ERROR, OK, read
from tests.ros.streams import BEGIN, MS

_HEADER = {"stamp": "builtin_interfaces/Time", "frame_id": "string"}
_TYPES = {
    "rig_msgs/Set": {
        "number": "uint64",
        "left": "geometry_msgs/Vector3Stamped",
        "right": "geometry_msgs/Vector3Stamped",
        "missing": "sequence<string>",
        "stamps": "sequence<builtin_interfaces/Time>",
        "header": "std_msgs/Header",
    },
    "geometry_msgs/Vector3Stamped": {"header": "std_msgs/Header", "vector": "geometry_msgs/Vector3"},
    "geometry_msgs/Vector3": {"x": "double", "y": "double", "z": "double"},
    "std_msgs/Header": _HEADER,
    "builtin_interfaces/Time": {"sec": "int32", "nanosec": "uint32"},
}
_DEFAULT = (
    ENCAPSULATION + bytes(8) + struct.pack("<iIIB3x24x", 0, 0, 1, 0) * 2 + struct.pack("<IIiIIB", 0, 0, 0, 0, 1, 0)
)


def _group(flow, **keys) -> GroupRelay:
    topics = [*inputs({"/left": VECTOR}), *inputs({"/right": VECTOR}, required=False)]
    bundle = {"topic": "/set", "type": "rig_msgs/msg/Set"}
    base = {"policy": "exact_time", "max_wait": "1s", "bundle": bundle, "outputs": False, "topics": topics}
    given = {key: value for key, value in {**base, **keys}.items() if value is not None}
    return GroupRelay(load_text(config({"front": given})).groups[0], now=lambda: 0, flow=flow)


def _bundle(group: GroupRelay) -> Bundle:
    return Bundle(group.config, _TYPES.__getitem__, _DEFAULT)


def _payload(content: bytes):
    return SimpleNamespace(name=content, content=lambda: content, received=BEGIN)


def _whole(number: int, left: bytes, right: bytes, missing: bytes, *stamps: int) -> bytes:
    """The bundle of vectors without a frame."""
    times = b"".join(struct.pack("<iI", *divmod(stamp, 10**9)) for stamp in stamps)
    header = struct.pack("<iIIB", *divmod(max(stamps), 10**9), 1, 0)
    return ENCAPSULATION + struct.pack("<Q", number) + left + right + missing + struct.pack("<I", 2) + times + header


@pytest.mark.parametrize("flow", FLOWS)
def test_sets_that_leave_at_once_are_bundled_whichever_input_comes_last(flow):
    topics = inputs({"/left": VECTOR, "/right": VECTOR})
    group, outlet, rights = _group(flow, topics=topics, outputs=True, max_wait=None), Outlet(), [Outlet(), Outlet()]
    connect(group, rights)
    group.connect_bundle(_bundle(group), outlet)
    contents = [vector(BEGIN + number * MS, frame_id="") for number in range(4)]
    for number, content in enumerate(contents):
        for index in (0, 1) if number % 2 else (1, 0):
            group.flow.receive(index, _payload(content), BEGIN + number * MS)
    none = struct.pack("<I", 0)
    stamps = [BEGIN + number * MS for number in range(4)]
    assert outlet.log == [
        _whole(number + 1, content[4:], content[4:], none, stamps[number], stamps[number])
        for number, content in enumerate(contents)
    ]
    assert [each.log for each in rights] == [contents, contents]
    assert [each for each, _ in group.flow.watched().sets] == [(stamp, stamp) for stamp in stamps]
    assert group.engine.sets == group.flow.n_sets == 4
    outlet.refusal = PublishError("no room")
    for index in (0, 1):
        group.flow.receive(index, _payload(contents[0]), BEGIN + 4 * MS)
    assert group.unpublished == {group.bundle_index: (1, "no room", False)}
    outlet.refusal = None
    for index in (0, 1):
        group.flow.receive(index, _payload(contents[0]), BEGIN + 5 * MS)
    assert (group.unpublished, outlet.sent, len(rights[0].log), group.failure) == ({}, 5, 6, None)


@pytest.mark.parametrize("flow", FLOWS)
@pytest.mark.parametrize("outputs", [True, False])
def test_what_cannot_be_bundled_is_told_until_a_set_leaves_again(flow, outputs):
    group, outlet, manifest = _group(flow, outputs=outputs), Outlet(), Outlet()
    topics = [(each.topic, each.output) for each in group.config.topics]
    queue = ManifestQueue(bugs=Bugs())
    group.tell_sets(
        queue.begin("front", ManifestWriter(group.config, node="/n", topics=topics, bundle="/set"), manifest)
    )
    if outputs:
        connect(group, [Outlet(), Outlet()])
    good = vector(BEGIN)
    group.disconnect_bundle("no type")
    for index in (0, 1):
        group.flow.receive(index, _payload(good), BEGIN - MS)
    group.connect_bundle(_bundle(group), outlet)
    assert not group.unpublished
    for stamp, content, refusal in (
        (BEGIN, good[:-1], None),
        (BEGIN + MS, good, PublishError("no room")),
    ):
        outlet.refusal = refusal
        for index in (0, 1):
            group.flow.receive(index, _payload(content), stamp)
    assert group.unpublished[group.bundle_index] == (2, "no room", False)
    outlet.refusal = None
    for index in (0, 1):
        group.flow.receive(index, _payload(good), BEGIN + 2 * MS)
    assert not group.unpublished
    assert (group.flow.n_sets, outlet.sent, group.failure) == (4, 1, None)
    queue.publish()
    told = [read(each) for each in manifest.log]
    whys = ["no type", "left is cut off, or of another type", "no room"]
    said = [f"bundle not published: {why}" for why in whys] if outputs else ["2 of 2 not published"] * 3
    assert [(each.level, each.message) for each in told] == [*((ERROR, each) for each in said), (OK, "complete")]
    assert [each.bundle_sequence for each in told] == ["0", "0", "0", "1"]
    if outputs:
        assert {one.message for each in told for one in each.inputs} == {""}
    else:
        assert [{one.message for one in each.inputs} for each in told] == [*({why} for why in whys), {""}]


def test_an_input_without_a_field_is_refused():
    group = _group(FLOWS[0])
    types = {**_TYPES, "rig_msgs/Set": {"left": "geometry_msgs/Vector3Stamped"}}
    with pytest.raises(BundleError, match="rig_msgs/msg/Set has too few fields of geometry_msgs/msg/Vector3Stamped"):
        Bundle(group.config, types.__getitem__, _DEFAULT)


def test_a_type_that_holds_arrays_of_an_inputs_messages_has_no_field_for_it():
    types = {**_TYPES, "rig_msgs/Set": {"all": "sequence<geometry_msgs/Vector3Stamped, 3>", "number": "uint64"}}
    with pytest.raises(BundleError, match="it holds no messages; a bundle fills no arrays of messages, as all"):
        Bundle(_group(FLOWS[0]).config, types.__getitem__, _DEFAULT)
