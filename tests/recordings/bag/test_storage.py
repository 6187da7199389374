"""Recordings behind URLs, from a server of this machine that counts, breaks off and lies."""

import random
import re
import struct
import sys
import zlib
from argparse import Namespace
from collections.abc import Sequence
from contextlib import closing
from itertools import chain
from pathlib import Path
from typing import Any
from unittest.mock import patch
from uuid import uuid4

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType
from rosbags.rosbag2 import StoragePlugin

from syncrelay import urls
from syncrelay.cli.completion import COMPLETERS
from syncrelay.errors import BagError, StorageError, UnavailableError
from syncrelay.recordings.bag import is_recording, open_recording, remote_file
from syncrelay.recordings.bag.remote_file import RemoteFile
from syncrelay.recordings.bag.storage import files_of, find, metadata_of
from syncrelay.urls import redacted
from tests.faults.extent import chosen
from tests.recordings.bag.damage import FRAMES, KINDS, damaged
from tests.recordings.bag.file_server import FileServer, file_server
from tests.recordings.bag.making import rig, write_mcap, write_ros1, write_rosbag2
from tests.recordings.bag.reading import full_disk, read
from tests.ros.frames import Frame

fsspec = pytest.importorskip("fsspec", reason="the extra `fleet` is not installed")
pytest.importorskip("aiohttp", reason="the extra `fleet` is not installed")

_SMALL = {"/camera", "/lidar"}
_SECRETS = ("hush", "AKIA", "X-Amz")


@pytest.fixture(autouse=True)
def _quick(monkeypatch):
    monkeypatch.setattr(urls, "_FIRST_WAIT", 0.01)


@pytest.fixture
def server():
    with file_server() as served:
        yield served


def rig_with_images(count: int = 30, size: int = 60_000) -> list[Frame]:
    """The rig, and with each lidar message an image that no codec makes smaller."""
    frames, chance = rig(count), random.Random(19)
    images = [
        frame._replace(topic="/image", payload=frame.payload + chance.randbytes(size))
        for frame in frames
        if frame.topic == "/lidar"
    ]
    return sorted(frames + images, key=lambda frame: frame.time)


def served_as(server: FileServer, path: Path, at: str = "/rig.mcap") -> str:
    server.files[at] = path.read_bytes()
    return server.url(at)


# Options of the writer, what is read, how many requests for it, and for how many thousandths of the file.
_FETCHED: dict[str, tuple[dict[str, Any], set[str] | None, tuple[int, int]]] = {
    "two topics in chunks of many images": ({"chunk_size": 1_000_000}, _SMALL, (48, 17)),
    "two topics in chunks of an image each": ({"chunk_size": 50_000}, _SMALL, (85, 18)),
    "two topics in chunks of a message each": ({"chunk_size": 1}, _SMALL, (46, 18)),
    "two topics in chunks that are packed": ({"compression": CompressionType.ZSTD}, _SMALL, (5, 1012)),
    "the images": ({"chunk_size": 50_000}, {"/image"}, (45, 1012)),
    "the index alone": ({}, set(), (4, 13)),
    "all of it": ({"chunk_size": 50_000}, None, (5, 1011)),
    # An index that cannot be trusted leaves out nothing.
    "one topic without a checksum": ({"chunk_size": 50_000, "enable_crcs": False}, {"/camera"}, (5, 1011)),
    "one topic without statistics": ({"chunk_size": 50_000, "use_statistics": False}, {"/camera"}, (5, 1011)),
}


@pytest.mark.parametrize("case", _FETCHED)
def test_no_more_is_fetched_than_what_is_wanted_and_in_few_requests(case, server, tmp_path):
    options, topics, fetched = _FETCHED[case]
    path = write_mcap(tmp_path / "rig.mcap", rig_with_images(40), **options)
    assert read(served_as(server, path), topics=topics) == read(path, topics=topics)
    assert (len(server.requests), round(1000 * server.sent / path.stat().st_size)) == fetched


def _with_summary(path: Path, old: bytes, new: bytes) -> None:
    """Change the last such bytes of an MCAP file, and set the checksum of its summary right."""
    content = bytearray(path.read_bytes())
    at = content.rindex(old)
    content[at : at + len(old)] = new
    footer = len(content) - 8 - 20
    (begin,) = struct.unpack_from("<Q", content, footer)
    struct.pack_into("<I", content, footer + 16, zlib.crc32(content[begin : footer + 16]))
    path.write_bytes(content)


def test_an_index_that_hides_a_channel_is_told_by_the_statistics(server, tmp_path):
    path = write_mcap(tmp_path / "rig.mcap", rig(30), chunk_size=600, compression=CompressionType.ZSTD)
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None
        chunk = summary.chunk_indexes[-1]
    entries = b"".join(struct.pack("<HQ", *each) for each in chunk.message_index_offsets.items())
    numbers = list(chunk.message_index_offsets)
    assert len(numbers) == 2
    hidden = struct.pack("<HQ", numbers[1], chunk.message_index_offsets[numbers[0]])
    _with_summary(path, entries, hidden + entries[10:])
    for topic in ("/camera", "/lidar"):
        (near, near_faults, _), (far, far_faults, _) = (
            read(each, topics={topic}) for each in (path, served_as(server, path))
        )
        assert (near, near_faults) == (far, far_faults)
        assert near_faults == [] or "of the 30 messages in its statistics" in near_faults[0]
        assert bool(near_faults) == (len(near) < 30)


def test_an_index_of_messages_that_lies_hides_none_unsaid(tmp_path):
    path = write_mcap(tmp_path / "rig.mcap", rig_with_images(20, size=100), chunk_size=1000)
    near, content = read(path, topics={"/camera"}), path.read_bytes()
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    for number, begin in summary.chunk_indexes[1].message_index_offsets.items():
        # Opcode, length, channel, number of bytes that follow; for each message its time and place.
        length = 9 + int.from_bytes(content[begin + 1 : begin + 9], "little")
        for at in range(length):
            flipped = content[begin + at] ^ 1 << at % 8
            changed = content[: begin + at] + bytes([flipped]) + content[begin + at + 1 :]
            fsspec.filesystem("memory").pipe(f"/{tmp_path.name}", changed)
            far = read(f"memory://{tmp_path.name}", topics={"/camera"})
            is_read = summary.channels[number].topic == "/camera" and not 11 <= at < 15
            assert far == near or (not is_read and far.faults), (number, at)


def test_statistics_that_count_a_message_more_than_there_is_are_noticed(server, tmp_path):
    path = write_mcap(tmp_path / "rig.mcap", rig(30), chunk_size=1)
    _with_summary(path, struct.pack("<HQ", 1, 30), struct.pack("<HQ", 1, 31))
    for word in (path, served_as(server, path)):
        assert read(word).faults == ["the index finds 60 of the 61 messages in its statistics"]
        assert read(word, topics={"/camera"}).faults == []


@pytest.mark.parametrize("kind", [kind for kind in KINDS if "index" not in kind])
@pytest.mark.long
def test_whatever_became_of_it_is_read_as_a_file_of_this_machine_is(kind, server, tmp_path):
    path = KINDS[kind](tmp_path)
    url = served_as(server, path, "/rig")
    # Nothing is copied as a whole of what has an index.
    is_copied = not kind.startswith("MCAP") or "without chunks" in kind
    assert bool(read(url).told) == is_copied
    for what, content in damaged(path.read_bytes(), places=chosen(short=2, long=20), seed=19):
        path.write_bytes(content)
        server.files["/rig"] = content
        for topics in (None, {"/camera"}):
            assert _outcome(url, topics) == _outcome(str(path), topics), what


def _outcome(word: str, topics: set[str] | None) -> object:
    try:
        frames, faults, _ = read(word, topics=topics)
    except BagError as error:
        return str(error).replace(word, "")
    return frames, faults


def test_a_file_that_was_not_closed_is_fetched_once(server, tmp_path):
    path = KINDS["MCAP without chunks or an index"](tmp_path)
    path.write_bytes(path.read_bytes()[:-200])
    near, near_faults, _ = read(path)
    far, far_faults, (told,) = read(served_as(server, path))
    assert (near, near_faults) == (far, far_faults)
    assert "copied here as a whole" in told
    assert "it has no index that can be trusted" in told
    assert server.sent < path.stat().st_size + 70_000


@pytest.mark.parametrize("fault", ["drop", "cut", "500", "503", "429", "shifted", "short", "whole"])
@pytest.mark.parametrize("number", chosen(short=[1], long=[1, 2]))
@pytest.mark.long
def test_what_goes_wrong_once_is_tried_again(fault, number, server, tmp_path):
    path = write_mcap(tmp_path / "rig.mcap", rig_with_images(10))
    server.fault = lambda request: fault if request == number else ""
    url = served_as(server, path)
    frames, faults, told = read(url)
    assert (frames, faults) == read(path)[:2]
    # A server that once sends the whole for a part may be one that has no parts.
    assert told == [] or fault == "whole"
    assert len(server.requests) > number + 1


@pytest.mark.parametrize(
    ("fault", "why"),
    [
        ("drop", "the server closed the connection without an answer"),
        ("cut", "the connection was lost in the middle of an answer"),
        ("503", "the server answered 503"),
        ("shifted", "asked for 10 bytes, 9 came"),
        ("short", "asked for 10 bytes, 5 came"),
        ("whole", "the server did not send the bytes that were asked for"),
    ],
)
def test_what_stays_wrong_is_tried_so_often_and_then_said(fault, why, server):
    server.files["/rig.mcap"] = bytes(100)
    remote = RemoteFile(server.url("/rig.mcap?X-Amz-Signature=hush"))
    server.fault = lambda _: fault
    server.forget()
    with pytest.raises(StorageError) as raised:
        remote.read(10, 10)
    assert str(raised.value).startswith(f"{server.url('/rig.mcap')}?...: {why}")
    assert "(5 attempts): try again later" in str(raised.value)


_CHAINED = "`::` in a URL is not supported"


@pytest.mark.parametrize(
    ("word", "fault", "why"),
    [
        ("/rig.mcap", "silent", r"the server did not answer in time \(5 attempts\): try again later"),
        ("/rig.mcap", "circle", "the server redirects too often"),
        ("/rig.mcap", "endless", "the server does not tell its size, so its end is unknown: copy it here"),
        ("http://127.0.0.1:1/rig.mcap", "", r"cannot connect to the server \(5 attempts\): try again later"),
        ("http://host:99999/rig.mcap", "", "is not the URL of a server: check it"),
        ("http://host:abc/rig.mcap", "", "is not the URL of a server: check it"),
        ("what://host/rig.mcap", "", "no library reads what:// URLs: expected s3://, gs://, .*"),
        ("simplecache::s3://bucket/rig.mcap", "", f"{_CHAINED}.*"),
        ("zip://rig.mcap::file:///x.zip", "", f"{_CHAINED}.*"),
        ("memory://a::b.mcap", "", f"{_CHAINED}.*"),
    ],
)
def test_what_leads_to_no_file_is_said(word, fault, why, server, monkeypatch):
    monkeypatch.setattr(urls, "_BYTES_WITHIN", 0.05 if fault == "silent" else 60)
    server.files["/rig.mcap"] = bytes(100)
    server.fault = lambda _: fault
    url = server.url(word) if word.startswith("/") else word
    with pytest.raises(StorageError, match=f"{re.escape(url)}: {why}$"):
        open_recording([url])


@pytest.mark.parametrize(("status", "why"), [(401, "access denied"), (403, "access denied"), (404, "no such file")])
def test_what_no_second_time_can_mend_is_said_at_once(status, why, server):
    server.fault = lambda _: str(status)
    with pytest.raises(StorageError) as raised:
        open_recording([server.url("/rig.mcap?X-Amz-Credential=AKIA&X-Amz-Signature=hush")])
    assert f"/rig.mcap?...: {why}" in str(raised.value)
    assert not any(secret in str(raised.value) for secret in _SECRETS)
    assert raised.value.__cause__ is None
    # fsspec asks by HEAD, and then by GET, as the signature of a URL may be for that alone.
    assert len(server.requests) == 2


@pytest.mark.parametrize("change", ["another", "gone"])
@pytest.mark.parametrize("tag", ['"one"', 'W/"one"', ""])
def test_a_file_that_is_replaced_while_it_is_read_is_no_recording(tag, change, server, tmp_path):
    server.etags["/rig.mcap"] = tag
    url = served_as(server, write_mcap(tmp_path / "rig.mcap", rig_with_images(10)))
    with closing(open_recording([url])) as recording:
        if change == "another":
            server.etags["/rig.mcap"] = tag.replace("one", "two")
            server.dates["/rig.mcap"] = "Mon, 23 Nov 2026 05:00:01 GMT"
        else:
            server.files["/rig.mcap"] = b""
        with pytest.raises(StorageError, match="was replaced or removed while it was being read"):
            list(recording.batches(recording.channels))


@pytest.mark.parametrize("tag", ['W/"one"', ""])
def test_a_file_of_which_the_server_tells_no_version_is_read(tag, server, tmp_path):
    server.etags["/rig.mcap"], server.dates["/rig.mcap"] = tag, ""
    path = write_mcap(tmp_path / "rig.mcap", FRAMES)
    assert read(served_as(server, path)) == read(path)


@pytest.mark.parametrize("fault", ["", "drop", "cut"])
def test_a_server_without_ranges_sends_the_whole_and_that_is_said(fault, server, tmp_path):
    path = write_mcap(tmp_path / "rig.mcap", FRAMES)
    server.has_ranges = False
    server.fault = lambda request: fault if request == 1 else ""
    far, faults, (told,) = read(served_as(server, path))
    assert (far, faults) == read(path)[:2]
    assert "its server cannot send parts of it" in told


def test_an_empty_file_is_said_to_be_empty(server):
    server.files["/rig.mcap"] = b""
    with pytest.raises(BagError, match=r"rig\.mcap: is empty"):
        open_recording([server.url("/rig.mcap")])


def test_to_tell_and_to_complete_a_word_nothing_is_fetched(server, tmp_path):
    url = server.url("/rig.mcap")
    assert is_recording(url)
    assert is_recording("s3://bucket/day/")
    assert not is_recording("/camera/image")
    assert not is_recording(str(tmp_path))
    (tmp_path / "rig.mcap").touch()
    assert is_recording(str(tmp_path))
    assert list(COMPLETERS["BAG|TOPIC"](prefix=f"{url}/x", parsed_args=Namespace(bag=url, more=[]))) == []
    assert find(url) == [url]
    assert server.requests == []


@pytest.mark.parametrize(
    ("word", "shown"),
    [
        ("https://host/a.mcap", "https://host/a.mcap"),
        ("https://me:hush@host/a.mcap", "https://host/a.mcap"),
        ("https://me:hu/sh@host/a.mcap", "https://host/a.mcap"),
        ("https://host:8443/a@2.mcap", "https://host:8443/a@2.mcap"),
        ("http://[::1]:80/a.mcap?X-Amz-Signature=hush", "http://[::1]:80/a.mcap?..."),
        ("HTTPS://hush@host/a.mcap?AKIA#hush", "https://host/a.mcap?..."),
        ("https://host/a.mcap?user=me@x:y", "https://host/a.mcap?..."),
        ("s3://AKIA:hush@bucket/a/run?.mcap", "s3://bucket/a/run?.mcap"),
        ("/data/a?b@c.mcap", "/data/a?b@c.mcap"),
        ("simplecache::https://me:hush@host/a.mcap?AKIA", "simplecache::https://host/a.mcap?..."),
        ("zip://a.mcap::https://me:hush@host/a.zip?AKIA", "zip://a.mcap::https://host/a.zip?..."),
    ],
)
def test_what_is_secret_in_a_url_is_never_shown(word, shown):
    assert redacted(word) == shown


@pytest.mark.parametrize("kind", ["rig.mcap", "rig.bag", "folder"])
def test_a_recording_is_read_from_whatever_fsspec_knows(kind, tmp_path):
    memory = fsspec.filesystem("memory")
    if kind == "folder":
        path = write_rosbag2(tmp_path / "rig", FRAMES, plugin=StoragePlugin.MCAP)
    else:
        path = (write_ros1 if kind == "rig.bag" else write_mcap)(tmp_path / kind, FRAMES)
    memory.put(str(path), f"/{tmp_path.name}/{path.name}", recursive=True)
    near, faults, _ = read(path)
    for word in (f"memory://{tmp_path.name}/{path.name}", path.as_uri()):
        assert read(word)[:2] == (near, faults)
        assert [each.rpartition("/")[2] for each in find(word)] == [path.name]
    assert len(near) == len(FRAMES)


def test_where_the_library_is_missing_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "aiohttp", None)
    with pytest.raises(UnavailableError, match=r"https:// URLs is not installed: pip install 'syncrelay\[fleet\]'"):
        open_recording(["https://host/rig.mcap"])


def test_where_a_library_is_missing_that_the_extra_does_not_bring_fsspec_says_which(monkeypatch):
    monkeypatch.setitem(sys.modules, "paramiko", None)
    monkeypatch.delitem(sys.modules, "fsspec.implementations.sftp", raising=False)
    with pytest.raises(UnavailableError, match='sftp:// URLs is not installed: SFTPFileSystem requires "paramiko"'):
        open_recording(["sftp://host/rig.mcap"])


def in_memory(content: bytes) -> RemoteFile:
    fsspec.filesystem("memory").pipe("/content", content)
    return RemoteFile("memory://content")


def test_where_there_is_no_space_for_a_copy_that_is_said(tmp_path):
    vast = in_memory(b"")
    vast.size = 2**60
    with pytest.raises(BagError, match=r"cannot be copied to .* bytes, and .* are free, set TMPDIR"):
        vast.download(tmp_path / "rig.bag")
    with full_disk(), pytest.raises(BagError, match=r"cannot be copied to .*: no space is left, set TMPDIR"):
        in_memory(bytes(50_000)).download(tmp_path / "rig.bag")


# By a word, what is found below a folder or by a pattern, and which files are read of it.
FOUND = {
    "": (["day/a_2.mcap", "day/a_10.mcap", "day/rig"], None),
    "/day/": (["day/a_2.mcap", "day/a_10.mcap", "day/rig"], ["day/a_2.mcap", "day/a_10.mcap"]),
    "/day/*": (
        ["day/a_2.mcap", "day/a_10.mcap", "day/rig"],
        ["day/a_2.mcap", "day/a_10.mcap", "day/notes.txt", "day/rig/rig.db3"],
    ),
    "/**/*.mcap": (["day/a_2.mcap", "day/a_10.mcap"], ["day/a_2.mcap", "day/a_10.mcap"]),
    "/day/rig": (["day/rig"], ["day/rig/rig.db3"]),
    "/day/rig/metadata.yaml": (["day/rig"], ["day/rig/rig.db3"]),
    "/day/a_2.mcap": (["day/a_2.mcap"], ["day/a_2.mcap"]),
    # Whatever its name is: it was named.
    "/day/notes.txt": (["day/notes.txt"], ["day/notes.txt"]),
    "/day/*.txt": (None, ["day/notes.txt"]),
}


@pytest.mark.parametrize("word", FOUND)
def test_recordings_are_found_below_folders_and_by_patterns(word):
    store = f"memory://{uuid4().hex}"
    for name in ("day/a_2.mcap", "day/a_10.mcap", "day/notes.txt", "day/rig/rig.db3", "day/rig/metadata.yaml"):
        fsspec.filesystem("memory").pipe(f"{store}/{name}", b"rig")
    for look, expected in zip((find, files_of), FOUND[word], strict=True):
        if expected is None:
            with pytest.raises(BagError, match="holds no recording"):
                look(f"{store}{word}")
        else:
            assert [each.removeprefix(f"{store.replace('//', '///')}/") for each in look(f"{store}{word}")] == expected
    has_metadata = word.startswith("/day/rig")
    assert (metadata_of(f"{store}{word}") is not None) == has_metadata


_CONTENT = random.Random(19).randbytes(300_000)
_SPANS = st.lists(st.tuples(st.integers(0, 300_000), st.integers(0, 90_000)), max_size=12)


@given(planned=_SPANS, others=_SPANS)
def test_whatever_is_planned_what_is_read_is_what_is_there(planned: Sequence, others: Sequence):
    remote = in_memory(_CONTENT)
    asked: list[tuple[int, int]] = []
    fetch = remote._fetch_range  # noqa: SLF001  what leaves for the server

    def counted(begin: int, end: int) -> bytes:
        asked.append((begin, end))
        return fetch(begin, end)

    remote._fetch_range = counted  # noqa: SLF001
    with patch.object(remote_file, "_AT_ONCE", 50_000):
        remote.expect(planned)
        for begin, size in chain.from_iterable(zip(planned, others, strict=False)):
            assert remote.read(begin, size) == _CONTENT[begin : begin + size]
    assert all(0 < end - begin <= 50_000 for begin, end in asked)
    allowed = [*planned, *others]
    for begin, end in asked:
        # At most what lies between two parts that stand close together.
        assert sum(1 for place in range(begin, end, 1000) if not _is_near(place, allowed)) == 0


def _is_near(place: int, spans: Sequence[tuple[int, int]]) -> bool:
    return any(begin - 32_000 <= place <= begin + size + 32_000 for begin, size in spans)


@pytest.mark.real_data
@pytest.mark.parametrize(
    "bag", ["event_camera_mcap/test_events_2/test_events_2_0.mcap", "multicam_tagslam/test_2.tag_detections.bag.bz2"]
)
def test_real_recordings_are_the_same_behind_a_url(bag, server, real_data: Path):
    path = real_data / bag
    far, faults, _ = read(served_as(server, path))
    assert (far, faults) == read(path)[:2]
    assert server.sent < 1.02 * path.stat().st_size
