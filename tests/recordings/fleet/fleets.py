"""A small fleet's recordings, the command on them, and what it leaves."""

import json
from pathlib import Path

from tests.cli.command import run
from tests.recordings.bag.making import rig, write_mcap
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs

TOPICS = ("/camera", "/lidar")
FILE = "f.yaml"
LEDGER = "_ledger.jsonl"


def file_text(slop="5ms", topics=TOPICS):
    """A file with one group."""
    group = {"policy": "approximate_time", "slop": slop, "topics": inputs(dict.fromkeys(topics, VECTOR))}
    return config({"front": group})


def make_fleet(folder: Path, counts=(20, 30, 40)) -> Path:
    """A folder with a file and, below `bags`, a recording of so many frames each."""
    (folder / FILE).write_text(file_text())
    (folder / "bags").mkdir()
    for number, count in enumerate(counts):
        write_mcap(folder / "bags" / f"r{number}.mcap", rig(count))
    return folder


def replay_into(folder, *words, into="out", bags="bags"):
    """Run `syncrelay fleet replay` to its end."""
    return run("fleet", "replay", bags, "--config", FILE, "--into", into, *words, folder=folder)


def entries(out: Path) -> dict[str, dict]:
    """The last line of each recording in a ledger, by the recording's name without its hash."""
    lines = [json.loads(line) for line in (out / LEDGER).read_text().splitlines()[1:]]
    return {line["name"].rpartition("-")[0]: line for line in lines}


def result(out: Path, name: str) -> Path:
    """The folder of a result, by the recording's name without its hash."""
    (found,) = [path for path in out.iterdir() if path.name.rpartition("-")[0] == name]
    return found


def tree(out: Path) -> dict[str, object]:
    """All that stands in a folder of results: the bytes of each file, of the ledger what counts, whatever its order."""
    found: dict[str, object] = {
        path.relative_to(out).as_posix(): path.read_bytes() if path.is_file() else "folder"
        for path in out.rglob("*")
        if path.name != LEDGER
    }
    return {**found, LEDGER: entries(out)}
