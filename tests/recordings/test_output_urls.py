"""What commands write behind URLs, where fsspec knows one more store: a folder, as if it were far away."""

import json
import resource
from pathlib import Path

import pyarrow.dataset
import pyarrow.parquet
import pytest

from tests.cli.command import run_here
from tests.recordings.bag.making import rig, rig_file, write_mcap
from tests.recordings.store import known_store

pytestmark = pytest.mark.process


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "f.yaml").write_text(rig_file("rig"))
    (tmp_path / "store").mkdir()
    write_mcap(tmp_path / "rig.mcap", rig())
    return tmp_path


def stored(folder: Path, *words: str, wrong: int = 0, file_size: int = -1):
    """Run syncrelay where store:// is the folder `store`, which refuses the first files; no file may be larger."""
    _, most = resource.getrlimit(resource.RLIMIT_FSIZE)
    with known_store(folder / "store", wrong):
        resource.setrlimit(resource.RLIMIT_FSIZE, (file_size, most))
        try:
            return run_here(*words, folder=folder)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))


def names(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


@pytest.mark.parametrize("name", ["out.mcap", "out"])
def test_a_replay_is_written_to_a_store_as_to_a_disk(name, folder):
    words = ["replay", "rig.mcap", "--config", "f.yaml", "-o"]
    far = stored(folder, *words, f"store://day/{name}", wrong=2)
    assert far.returncode == 0, far.stderr
    assert f"wrote store://day/{name}: " in far.stderr
    assert run_here(*words, name, folder=folder).returncode == 0
    assert names(folder / "store" / "day") == [
        str(path.relative_to(folder)) for path in sorted([folder / name, *(folder / name).rglob("*")]) if path.is_file()
    ]
    for path in names(folder / "store" / "day"):
        assert (folder / "store" / "day" / path).read_bytes() == (folder / path).read_bytes()
    again = stored(folder, *words, f"store://day/{name}")
    assert (again.returncode, "already exists and is not overwritten" in again.stderr) == (1, True)


def test_what_a_store_refuses_ends_the_command_and_leaves_nothing_behind(folder):
    words = ["replay", "rig.mcap", "--config", "f.yaml", "-o", "store://day/out"]
    done = stored(folder, *words, wrong=100)
    assert done.returncode == 1
    why = "the store cannot be reached: Connection reset by peer (5 attempts): try again later\n"
    assert f"store://day/out: {why}" in done.stderr
    assert names(folder / "store") == []
    assert not [path for path in folder.iterdir() if path.name.startswith(".syncrelay")]


_NOT_HERE = "cannot be written to a temporary folder of this machine before the upload: File too large"


@pytest.mark.parametrize(
    ("limit", "why"),
    [
        ({"wrong": -1}, "cannot be written: No space left on device\n"),
        ({"file_size": 1000}, f"{_NOT_HERE}: set TMPDIR to another folder\n"),
    ],
    ids=["in the store", "here"],
)
def test_where_there_is_no_space_is_said(limit, why, folder):
    words = ["replay", "rig.mcap", "--config", "f.yaml", "-o", "store://day/out"]
    done = stored(folder, *words, **limit)
    assert (done.returncode, done.stderr) == (1, f"syncrelay: store://day/out: {why}")
    assert names(folder / "store") == []


@pytest.mark.parametrize(
    "words",
    [
        ["replay", "rig.mcap", "--config", "f.yaml", "-o", "https://me:hush@host/out.mcap"],
        ["analyze", "rig.mcap", "--config", "f.yaml", "--html", "https://me:hush@host/report.html"],
        ["export", "rig.mcap", "--config", "f.yaml", "-o", "https://me:hush@host/out"],
    ],
)
def test_a_server_takes_no_files_and_that_is_said(words, folder):
    done = run_here(*words, folder=folder)
    assert done.returncode == 1
    assert "a server takes no files: expected a path, s3://, gs:// or another store" in done.stderr
    assert "hush" not in done.stderr


@pytest.mark.parametrize("name", ["out", "out.mcap"])
def test_a_chain_of_urls_is_refused_and_makes_no_folder(name, folder):
    before = sorted(folder.iterdir())
    done = run_here("replay", "rig.mcap", "--config", "f.yaml", "-o", f"simplecache::s3://bucket/{name}", folder=folder)
    assert (done.returncode, "`::` in a URL is not supported" in done.stderr) == (1, True)
    assert sorted(folder.iterdir()) == before


def test_an_analysis_is_written_to_a_store_and_over_its_own_report_alone(folder):
    words = ["analyze", "rig.mcap", "--config", "f.yaml", "--html", "store://day/report.html"]
    for _ in range(2):
        assert stored(folder, *words).returncode == 0
    report = folder / "store" / "day" / "report.html"
    assert b"<html" in report.read_bytes()[:500]
    report.write_text("mine")
    assert "already exists" in stored(folder, *words).stderr
    assert report.read_text() == "mine"
    done = stored(folder, *words[:-1], "store://day")
    assert (done.returncode, "store://day: already exists and is not overwritten" in done.stderr) == (1, True)


def test_the_results_of_a_fleet_are_kept_in_a_store_and_done_once(folder):
    (folder / "day").mkdir()
    for name in ("a", "b"):
        write_mcap(folder / "day" / f"{name}.mcap", rig())
    words = ["export", "day", "--config", "f.yaml", "--jobs", "2", "-o"]
    done = stored(folder, *words, "store://results/of day", wrong=1)
    assert (done.returncode, done.stdout) == (0, "store://results/of day: 2 recordings: 2 done\n"), done.stderr
    into = folder / "store" / "results" / "of day"
    assert run_here(*words, "here", folder=folder).returncode == 0
    assert names(into) == names(folder / "here")
    entries = [json.loads(line) for line in (into / "_ledger.jsonl").read_text().splitlines()[1:]]
    assert [entry["state"] for entry in entries] == ["done", "done"]
    assert "--overwrite" in stored(folder, *words, "store://results/of day", "--raw").stderr
    tables = [pyarrow.dataset.dataset(where).to_table().num_rows for where in (str(into), str(folder / "here"))]
    assert tables[0] == tables[1] > 70

    assert stored(folder, *words, "store://results/of day").stdout.endswith("2 done before\n")
    next(into.glob("b-*/*")).unlink()
    assert stored(folder, *words, "store://results/of day").stdout.endswith("1 done, 1 done before\n")
    (folder / "day" / "b.mcap").write_bytes(b"none any more")
    assert stored(folder, *words, "store://results/of day").returncode == 1
    assert [name for name in names(into) if name.startswith("b-")] == []


def test_the_table_of_facts_is_written_to_a_store(folder):
    words = ["fleet", "analyze", "rig.mcap", "nothing.mcap", "--config", "f.yaml", "--json", "--into"]
    (folder / "nothing.mcap").write_bytes(b"")
    far, near = stored(folder, *words, "store://new"), run_here(*words, "here", folder=folder)
    assert (far.returncode, far.stdout) == (near.returncode, near.stdout) == (1, near.stdout), far.stderr
    assert names(folder / "store" / "new") == names(folder / "here")
    tables = [
        pyarrow.parquet.read_table(where / "facts.parquet") for where in (folder / "store" / "new", folder / "here")
    ]
    assert tables[0].num_rows == 2
    assert tables[0] == tables[1]
