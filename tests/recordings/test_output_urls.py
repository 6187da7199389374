"""What commands write behind URLs, in a process whose fsspec knows one more store: a folder, as if it were far away."""

import json
from pathlib import Path

import pyarrow.dataset
import pyarrow.parquet
import pytest

from tests.cli.command import run, run_python
from tests.recordings.bag.making import rig, rig_file, write_mcap

pytest.importorskip("fsspec", reason="the extra `fleet` is not installed")
pytestmark = pytest.mark.process

# As a bucket: it has no folders of its own, and `wrong` files are refused so often; it is full where that is negative.
_STORE = """
import shutil, sys
import fsspec
from fsspec.implementations.local import LocalFileSystem

root, wrong = sys.argv[1], int(sys.argv[2])

class Store(LocalFileSystem):
    protocol = "store"

    @classmethod
    def _strip_protocol(cls, path):
        path = str(path)
        path = path.removeprefix("store://").rstrip("/")
        return path if path.startswith(root) else f"{root}/{path}".rstrip("/")

    def unstrip_protocol(self, name):
        return "store://" + self._strip_protocol(name)[len(root) + 1:]

    def put_file(self, source, target, **options):
        global wrong
        if wrong < 0:
            raise OSError(28, "No space left on device")
        if wrong and not target.endswith("_ledger.jsonl"):
            wrong -= 1
            raise ConnectionResetError(104, "Connection reset by peer")
        shutil.copy(source, target)

fsspec.register_implementation("store", Store)
from syncrelay import urls
urls._FIRST_WAIT = 0.01
from syncrelay.cli import main
sys.exit(main(sys.argv[3:]))
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "f.yaml").write_text(rig_file("rig"))
    (tmp_path / "store").mkdir()
    write_mcap(tmp_path / "rig.mcap", rig())
    return tmp_path


def stored(folder: Path, *words: str, wrong: int = 0):
    """Run syncrelay where store:// is the folder `store`, which refuses the first files."""
    return run_python("-c", _STORE, str(folder / "store"), str(wrong), *words, folder=folder)


def names(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


@pytest.mark.parametrize("name", ["out.mcap", "out"])
def test_a_replay_is_written_to_a_store_as_to_a_disk(name, folder):
    words = ["replay", "rig.mcap", "--config", "f.yaml", "-o"]
    far = stored(folder, *words, f"store://day/{name}", wrong=2)
    assert far.returncode == 0, far.stderr
    assert f"wrote store://day/{name}: " in far.stderr
    assert run(*words, name, folder=folder).returncode == 0
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


_FULL = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"


_NOT_HERE = "cannot be written to a temporary folder of this machine before the upload: File too large"


@pytest.mark.parametrize(
    ("script", "wrong", "why"),
    [
        (_STORE, -1, "cannot be written: No space left on device\n"),
        (_FULL + _STORE, 0, f"{_NOT_HERE}: set TMPDIR to another folder\n"),
    ],
    ids=["in the store", "here"],
)
def test_where_there_is_no_space_is_said(script, wrong, why, folder):
    words = ["replay", "rig.mcap", "--config", "f.yaml", "-o", "store://day/out"]
    done = run_python("-c", script, str(folder / "store"), str(wrong), *words, folder=folder)
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
    done = run(*words, folder=folder)
    assert done.returncode == 1
    assert "a server takes no files: expected a path, s3://, gs:// or another store" in done.stderr
    assert "hush" not in done.stderr


@pytest.mark.parametrize("name", ["out", "out.mcap"])
def test_a_chain_of_urls_is_refused_and_makes_no_folder(name, folder):
    before = sorted(folder.iterdir())
    done = run("replay", "rig.mcap", "--config", "f.yaml", "-o", f"simplecache::s3://bucket/{name}", folder=folder)
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


@pytest.mark.parametrize(("command", "option"), [("export", "-o"), ("replay", "--into")])
def test_the_results_of_a_fleet_are_kept_in_a_store_and_done_once(command, option, folder):
    (folder / "day").mkdir()
    for name in ("a", "b"):
        write_mcap(folder / "day" / f"{name}.mcap", rig())
    words = [command, "day", "--config", "f.yaml", "--jobs", "2", option]
    done = stored(folder, *words, "store://results/of day", wrong=1)
    assert (done.returncode, done.stdout) == (0, "store://results/of day: 2 recordings: 2 done\n"), done.stderr
    into = folder / "store" / "results" / "of day"
    assert run(*words, "here", folder=folder).returncode == 0
    assert names(into) == names(folder / "here")
    entries = [json.loads(line) for line in (into / "_ledger.jsonl").read_text().splitlines()[1:]]
    assert [entry["state"] for entry in entries] == ["done", "done"]
    if command == "export":
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
    words = ["analyze", "rig.mcap", "nothing.mcap", "--config", "f.yaml", "--json", "--into"]
    (folder / "nothing.mcap").write_bytes(b"")
    far, near = stored(folder, *words, "store://new"), run(*words, "here", folder=folder)
    assert (far.returncode, far.stdout) == (near.returncode, near.stdout) == (1, near.stdout), far.stderr
    assert names(folder / "store" / "new") == names(folder / "here")
    tables = [
        pyarrow.parquet.read_table(where / "facts.parquet") for where in (folder / "store" / "new", folder / "here")
    ]
    assert tables[0].num_rows == 2
    assert tables[0] == tables[1]


def test_a_store_with_other_files_is_no_place_for_results(folder):
    (folder / "store" / "mine").mkdir()
    (folder / "store" / "mine" / "notes").write_text("")
    done = stored(folder, "export", "rig.mcap", "--config", "f.yaml", "-o", "store://mine/")
    assert (done.returncode, "holds files and no _ledger.jsonl" in done.stderr) == (1, True)
