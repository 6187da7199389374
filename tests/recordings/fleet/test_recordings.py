"""From words to recordings, and the names of their results."""

import os
import random

import pytest

from syncrelay.errors import BagError
from syncrelay.recordings.fleet.recordings import find_sources, is_result_name, names_recordings, result_name
from tests.hostile_names import hostile_name
from tests.recordings.bag.making import rig, write_rosbag2


def found(folder, *words, into="out"):
    """The recordings that words name, relative to the folder."""
    sources = find_sources([word if "://" in word else f"{folder}/{word}" for word in words], into=folder / into)
    assert len({source.name for source in sources}) == len(sources)
    return [source.place.removeprefix(f"{folder}/") for source in sources]


@pytest.fixture
def folder(tmp_path):
    for name in ("a/x.mcap", "a/y.db3", "a/notes.txt", "b/deep/x.mcap", "b/z.bag.zst", ".hidden/h.mcap", "c/none.txt"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(b"")
    return tmp_path


def test_a_folder_is_searched_to_any_depth(folder):
    assert found(folder, ".") == ["a/x.mcap", "a/y.db3", "b/z.bag.zst", "b/deep/x.mcap"]


def test_a_file_is_a_recording_whatever_it_is_called(folder):
    assert found(folder, "a/notes.txt", "a/x.mcap") == ["a/notes.txt", "a/x.mcap"]


@pytest.mark.parametrize(
    ("pattern", "names"),
    [
        ("a/*", ["a/x.mcap", "a/y.db3"]),
        ("**/x.mcap", ["a/x.mcap", "b/deep/x.mcap"]),
        ("[ab]", ["a/x.mcap", "a/y.db3", "b/z.bag.zst", "b/deep/x.mcap"]),
    ],
)
def test_a_pattern_names_what_matches_and_is_a_recording(pattern, names, folder):
    assert found(folder, pattern) == names


def test_a_recording_that_several_words_name_is_one(folder):
    assert found(folder, "a/x.mcap", "a", "*/x.mcap", "b/../a/x.mcap") == ["a/x.mcap", "a/y.db3"]


def test_a_file_whose_name_is_a_pattern_is_itself(folder):
    (folder / "a" / "[x].mcap").write_bytes(b"")
    assert found(folder, "a/[x].mcap") == ["a/[x].mcap"]


def test_the_splits_of_a_rosbag2_folder_are_one_recording(folder):
    write_rosbag2(folder / "b" / "drive", rig(3))
    crashed = folder / "b" / "crashed"
    crashed.mkdir()
    for number in range(3):
        (crashed / f"crashed_{number}.mcap").write_bytes(b"")
    assert found(folder, "b") == ["b/z.bag.zst", "b/crashed", "b/deep/x.mcap", "b/drive"]
    assert found(folder, "b/drive/metadata.yaml", "b/crashed/*") == [
        "b/drive",
        *(f"b/crashed/crashed_{number}.mcap" for number in range(3)),
    ]


def test_a_list_names_a_recording_on_each_line(folder, monkeypatch):
    monkeypatch.chdir(folder)
    odd = os.fsencode(folder / "a") + b"/\xff\xfe.mcap"
    with open(odd, "wb"):  # noqa: PTH123  a name that is no text
        pass
    (folder / "list.txt").write_bytes(b"# monday\n\n a/x.mcap \nb/*\nhttps://day.example/one.mcap\n" + odd + b"\r\n")
    sources = find_sources(["@list.txt"], into=folder / "out")
    places = [os.fsencode(source.place) for source in sources]
    assert places == [
        os.fsencode(folder / "a/x.mcap"),
        os.fsencode(folder / "b/deep/x.mcap"),
        os.fsencode(folder / "b/z.bag.zst"),
        b"https://day.example/one.mcap",
        odd,
    ]


@pytest.mark.parametrize(
    ("word", "told"),
    [
        ("c", "c: holds no recording, expected files that end in .mcap"),
        ("none.mcap", "none.mcap: no such file or folder"),
        ("c/*", "none of the 1 files and folders is a recording"),
        ("none*", "none\\*: nothing there"),
        ("a/\0", "no such file or folder"),
    ],
)
def test_a_word_that_names_nothing_is_told(word, told, folder):
    with pytest.raises(BagError, match=told):
        found(folder, "a", word)


@pytest.mark.parametrize(("text", "told"), [("# all gone\n", "lists no recording"), (None, "cannot be read")])
def test_a_list_without_a_recording_is_told(text, told, tmp_path):
    if text is not None:
        (tmp_path / "list").write_text(text)
    with pytest.raises(BagError, match=rf"list: .*{told}"):
        find_sources([f"@{tmp_path}/list"], into=tmp_path / "out")


def test_a_link_that_leads_in_a_circle_ends(folder):
    (folder / "a" / "again").symlink_to(folder)
    assert found(folder, "a") == ["a/x.mcap", "a/y.db3"]


def test_names_of_results_stay_in_their_folder_and_apart(tmp_path):
    odd = [
        "/..",
        "/.",
        "/../x",
        "/-rf",
        "/.mcap",
        f"/{'long' * 500}.mcap",
        f"/{'点' * 300}",
        "/\udcff\udcfe.mcap",
        "/x\n",
    ]
    chance = random.Random(1)
    hostile = [f"/{hostile_name(chance)}" for _ in range(50)]
    paths = [*odd, *hostile, "/a/x.mcap", "/b/x.mcap", "/a/X.mcap"]
    names = {result_name(path) for path in paths}
    assert len({name.casefold() for name in names}) == len(set(paths))
    for name in names:
        assert is_result_name(name)
        (tmp_path / name).mkdir()
        assert (tmp_path / name).resolve().parent == tmp_path.resolve()
    assert len(list(tmp_path.iterdir())) == len(names)


@pytest.mark.parametrize(
    "name", ["..", "_ledger.jsonl", "../x-0123456789abcdef", ".-0123456789abcdef", "_x-0123456789abcdef", "x-012345678"]
)
def test_what_is_no_name_of_a_result_is_told_from_them(name):
    assert not is_result_name(name)


def test_topics_are_told_from_recordings(folder, monkeypatch):
    monkeypatch.chdir(folder)
    assert all(map(names_recordings, ["a", "x.mcap", "day*", "@list", "s3://b/k", "./c"]))
    assert not any(map(names_recordings, ["/camera", "/lidar/points", "imu"]))
