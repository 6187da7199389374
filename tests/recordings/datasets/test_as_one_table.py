"""The folder that `export` writes, read as one table by what reads folders of Parquet files."""

import os
import random
from importlib.util import find_spec
from pathlib import Path

import pyarrow as pa
import pyarrow.dataset as ds
import pytest

from tests.cli.command import run, run_python
from tests.consoles import blocks_of
from tests.faults.extent import IS_LONG, chosen
from tests.recordings.bag.making import write_mcap
from tests.recordings.datasets.times import TIME, rows_of
from tests.ros.cdr_messages import VECTOR, vector
from tests.ros.frames import Frame

FILE = f"""
version: 1
groups:
  front:
    policy: exact_time
    max_wait: 1ms
    topics:
      - {{topic: /a}}
      - {{topic: /b}}
      - {{topic: /c, type: {VECTOR}, required: false}}
"""
COLUMNS = ["stamp", "stamps", "received"]
_CASES = chosen(short=3, long=40)
_SEED = os.urandom(4).hex() if IS_LONG else "one table"
_LETTERS = "ab_.-é=%"


@pytest.mark.faults
@pytest.mark.parametrize("case", range(_CASES))
def test_all_rows_are_read_with_the_times_that_were_drawn(case, tmp_path):
    seed = f"{_SEED} {case}"
    chance = random.Random(seed)
    drawn = [row for name in _names(chance) for row in _recording(chance, tmp_path / "bags", name)]
    (tmp_path / "f.yaml").write_text(FILE)
    done = run("export", "bags", "--config", "f.yaml", "-o", "out", "--jobs", "1", folder=tmp_path)
    assert done.returncode == 0, (seed, done.stderr)
    table = ds.dataset(tmp_path / "out").to_table()
    assert {table.schema.field(name).type for name in ("stamp", "left_at")} == {TIME}
    for name in ("stamps", "received"):
        assert table.schema.field(name).type == pa.struct([(topic, TIME) for topic in ("/a", "/b", "/c")])
    expected = sorted(map(repr, drawn))
    assert sorted(repr(tuple(row.values())) for row in rows_of(table.select(COLUMNS))) == expected, seed
    for reader, count in _COUNTS.items():
        if find_spec(reader):
            assert count(tmp_path / "out") == len(drawn), (seed, reader)


@pytest.mark.process
def test_the_page_reads_the_folder_as_it_says(tmp_path):
    page = (Path(__file__).parents[3] / "docs/howto/datasets.md").read_text()
    (snippet,) = [block.text for block in blocks_of(page) if "ds.dataset(" in block.text]
    rows = [row for name in ("x", "y") for row in _recording(random.Random(name), tmp_path / "bags", name)]
    (tmp_path / "f.yaml").write_text(FILE)
    assert run("export", "bags", "--config", "f.yaml", "-o", "dataset", folder=tmp_path).returncode == 0
    done = run_python("-c", snippet, folder=tmp_path)
    assert (done.returncode, done.stdout.split()[0]) == (0, str(len(rows))), done.stderr
    assert "stamp: timestamp[ns, tz=UTC]" in done.stdout


def _names(chance: random.Random) -> list[str]:
    """Names of 1 to 4 recordings, some of which begin as hidden files do."""
    drawn = {"".join(chance.choices(_LETTERS, k=chance.randint(1, 4))) for _ in range(chance.randint(1, 4))}
    return [f"{start}{name}" for name in sorted(drawn) for start in [chance.choice(["_", ".", "x"])]]


def _recording(chance: random.Random, folder: Path, name: str) -> list[tuple[object, ...]]:
    """A recording of some sets; returns for each its stamp, its messages' stamps, and when they were received."""
    folder.mkdir(exist_ok=True)
    has_optional = chance.random() < 0.5
    stamp = chance.randrange(1, 2_000_000_000_000_000_000)
    frames: list[Frame] = []
    rows: list[tuple[object, ...]] = []
    for _ in range(chance.randint(1, 30)):
        stamp += chance.randrange(10_000_000, 500_000_000)
        topics = ["/a", "/b", *(["/c"] if has_optional and chance.random() < 0.7 else [])]
        received = {topic: stamp + chance.randrange(1_000_000) for topic in topics}
        frames += [Frame(topic, VECTOR, received[topic], vector(stamp)) for topic in topics]
        each = ("/a", "/b", "/c")
        stamps = {topic: stamp if topic in topics else None for topic in each}
        rows.append((stamp, stamps, {topic: received.get(topic) for topic in each}))
    write_mcap(folder / f"{name}.mcap", sorted(frames, key=lambda frame: frame.time))
    return rows


def _by_polars(out: Path) -> int:
    import polars as pl  # type: ignore[import-not-found]  # noqa: PLC0415  not among what tests install

    return int(pl.scan_parquet(out, hidden_file_prefix="_").collect().height)


def _by_duckdb(out: Path) -> int:
    import duckdb  # noqa: PLC0415  a quarter of a second

    ((count,),) = duckdb.read_parquet(f"{out}/*/*.parquet").count("*").fetchall()
    return int(count)


_COUNTS = {"polars": _by_polars, "duckdb": _by_duckdb}
