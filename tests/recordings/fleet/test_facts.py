"""A fleet drawn at random, analyzed from the command line; the ten queries of the docs find what was drawn."""

import json
import random
from collections import Counter
from dataclasses import dataclass
from math import isnan
from pathlib import Path
from typing import Any

import duckdb
import pyarrow.parquet as pq
import pytest

from syncrelay.errors import UsageError
from syncrelay.recordings.fleet.facts import FindingFacts, FleetRow, SlopTrial, SuggestedValue
from syncrelay.recordings.fleet.ledger import Entry, Ledger, State
from syncrelay.recordings.fleet.recordings import result_name
from syncrelay.recordings.fleet.robots import RobotPattern
from syncrelay.recordings.fleet.summary import Summary
from syncrelay.recordings.fleet.table import fleet_rows, write_table
from tests.cli.command import ROOT, run
from tests.hostile_names import assert_shown_safely, hostile_name
from tests.recordings.bag.making import write_mcap
from tests.recordings.fleet.fleets import FILE, file_text, result
from tests.ros.streams import at, merged

pytestmark = pytest.mark.process

_SEED = 29
_DRAWN = 18
_LASTS_S = 8
_DAYS = ("2023-11-14", "2023-11-15", "2023-11-16")
_QUERIES = [each for each in (ROOT / "configs" / "fleet.sql").read_text().split(";\n") if "SELECT" in each]


@dataclass(frozen=True)
class Drawn:
    """A recording whose truth is known: what befell it, where it lies, its day, and the camera's rate."""

    kind: str
    name: str
    robot: str
    day: int
    rate_hz: int

    @property
    def share(self) -> float | None:
        """Of its possible sets, with slop 5 ms; the last one may lack the message that would prove it the best."""
        return {"torn": None, "missing": 0, "wide": 0}.get(self.kind, 1)

    def write(self, folder: Path) -> None:
        path = folder / self.name
        path.parent.mkdir(parents=True, exist_ok=True)
        if self.kind == "torn":
            path.write_bytes(b"no recording")
            return
        period, begin = 1000 // self.rate_hz, self.day * 86_400_000
        times = range(0, _LASTS_S * 1000, period)
        apart = 15 if self.kind == "wide" else 3
        last = {"half": _LASTS_S * 500, "missing": 0}.get(self.kind, _LASTS_S * 1000)
        lidar = at("/lidar", *(begin + time + apart for time in times if time < last))
        write_mcap(path, merged(at("/camera", *(begin + time for time in times)), lidar))


def _draw() -> list[Drawn]:
    chance = random.Random(_SEED)
    kinds = ("good", "good", "wide", "half", "missing", "torn")
    recordings = []
    for number in range(_DRAWN):
        robot, day = f"robot_{chance.randrange(4)}", chance.randrange(3)
        kind, rate_hz = chance.choice(kinds), chance.choice((5, 10, 20))
        recordings.append(Drawn(kind, f"bags/{robot}/{day}/{kind}_{number}.mcap", robot, day, rate_hz))
    return recordings


class Fleet:
    """The drawn recordings, what the command printed of them, and the answers to the queries, by recordings' names."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.drawn = _draw()
        for each in self.drawn:
            each.write(folder)
        for slop, into in (("5ms", "old"), ("20ms", "new")):
            (folder / FILE).write_text(file_text(slop=slop))
            words = f"fleet analyze bags --config {FILE} --into {into} --jobs 2 --robot {{robot}}/{{day}}/*".split()
            self.ended = run(*words, folder=folder)
            assert self.ended.returncode == 1, self.ended.stderr
        self.as_json = run(*words, "--json", folder=folder).stdout
        (folder / "out").symlink_to("old")

    def of(self, *kinds: str) -> set[str]:
        return {each.name for each in self.drawn if each.kind in kinds}

    def ask(self, number: int) -> list[dict[str, Any]]:
        """The rows that a query of the page gives."""
        with duckdb.connect() as connection:
            connection.execute(f"SET file_search_path='{self.folder}'")
            found = connection.sql(_QUERIES[number])
            rows = [dict(zip(found.columns, values, strict=True)) for values in found.fetchall()]
        for row in rows:
            if "recording" in row:
                row["recording"] = row["recording"].removeprefix(f"{self.folder}/")
        return rows


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    drawn = Fleet(tmp_path_factory.mktemp("facts"))
    assert min(Counter(each.kind for each in drawn.drawn).values()) > 1
    return drawn


def test_each_query_of_the_page_finds_what_was_drawn(fleet):
    assert len(_QUERIES) == 10
    worst, below, days, findings, missing, slops, changed, unread, silent, rates = map(fleet.ask, range(10))
    torn, without, wide = fleet.of("torn"), fleet.of("missing"), fleet.of("wide")
    n_read = _DRAWN - len(torn)
    assert {row["recording"] for row in worst[: len(wide | without)]} == wide | without
    assert [row["share"] for row in worst] == sorted(row["share"] for row in worst)
    assert [(row["group_name"], row["below"], row["recordings"]) for row in below] == [
        ("front", len(wide | without), n_read)
    ]
    shares: dict[tuple[str, str], list[float]] = {}
    for each in fleet.drawn:
        if each.share is not None:
            shares.setdefault((each.robot, _DAYS[each.day]), []).append(each.share)
    assert [(row["robot"], row["day"], row["recordings"]) for row in days] == [
        (*day, len(shares[day])) for day in sorted(shares)
    ]
    for row in days:
        drawn = shares[row["robot"], row["day"]]
        assert row["mean_share"] == pytest.approx(sum(drawn) / len(drawn), abs=0.05)
    counts = {row["code"]: row["recordings"] for row in findings}
    assert (counts["over_slop"], counts["no_publisher"]) == (len(wide), len(without))
    assert [*counts.values()] == sorted(counts.values(), reverse=True)
    assert [(row["topic"], row["missing"], row["recordings"]) for row in missing] == [("/lidar", len(without), n_read)]
    both = [each for each in fleet.drawn if each.kind in ("good", "wide", "half")]
    # A set holds a message of the lidar, which is there half the time or always.
    sets = {each: each.rate_hz * _LASTS_S / (2 if each.kind == "half" else 1) for each in both}
    for row in slops:
        given = sum(sets[each] for each in both if row["slop_ms"] >= (15 if each.kind == "wide" else 3))
        assert row["share"] == pytest.approx(given / sum(sets.values()), abs=0.05), row
    assert {row["recording"] for row in changed} == wide
    assert all(row["old_share"] == 0 and row["change"] > 0.9 for row in changed)
    assert {row["recording"] for row in unread if row["error"]} == torn
    assert {row["recording"] for row in unread if row["problems"]} == without
    assert {row["recording"] for row in silent} == fleet.of("half", "missing")
    assert {row["topic"] for row in silent} == {"/lidar"}
    for row in rates:
        assert (row["least"], row["greatest"]) == pytest.approx((5, 20), rel=0.01), row


def test_the_lines_of_json_are_the_rows_of_the_table(fleet):
    rows = [json.loads(line) for line in fleet.as_json.splitlines()]
    assert rows == pq.read_table(fleet.folder / "new" / "facts.parquet").to_pylist()
    torn = next(row for row in rows if row["error"])
    assert (torn["group_name"], torn["share"], torn["inputs"]) == (None, None, [])


def test_the_summary_is_one_screen_about_the_same(fleet):
    lines = fleet.ended.stdout.splitlines()
    torn, missing = len(fleet.of("torn")), len(fleet.of("missing"))
    assert lines[0].startswith(f"{_DRAWN - torn} recordings of 4 robots, ")
    assert lines[0].endswith(", 2023-11-14 to 2023-11-16")
    assert lines[1].startswith(f"not analyzed: {torn} recordings, such as ")
    assert lines[2].endswith(f"below 80 % in {missing} of {_DRAWN - torn} rows")
    assert len(lines) <= 22
    assert max(map(len, lines)) <= 80
    assert f"facts.parquet: {_DRAWN} rows" in fleet.ended.stderr


@pytest.mark.parametrize("others", [(), ("bags/b.mcap",)])
def test_a_lost_result_of_a_recording_that_is_not_named_is_an_error_that_can_be_mended(tmp_path, others):
    (tmp_path / FILE).write_text(file_text())
    (tmp_path / "bags").mkdir()
    for name in ("a", "b"):
        write_mcap(tmp_path / "bags" / f"{name}.mcap", at("/camera", 0))
    words = ("--config", FILE, "--into", "out", "--jobs", "1")
    run("fleet", "analyze", "bags", *words, folder=tmp_path)
    lost = result(tmp_path / "out", "b") / "facts.jsonl"
    lost.unlink()
    ended = run("fleet", "analyze", "bags/a.mcap", *others, *words, folder=tmp_path)
    told = (
        f"syncrelay: out/{lost.parent.name}/facts.jsonl: cannot be read: remove this folder, and run the command again"
        f" with {tmp_path}/bags/b.mcap among the recordings\n"
    )
    assert (told in ended.stderr) is not bool(others)
    assert lost.exists() is bool(others)


@pytest.mark.parametrize(
    "rows",
    [
        (),
        (FleetRow(recording="/a", error="torn"),),
        (FleetRow(recording="/a", group_name="g", slop_trials=(SlopTrial(slop_ms=1, sets=0, of_messages=0),)),),
    ],
    ids=["no rows", "failed", "no messages"],
)
def test_the_queries_give_no_nan_and_no_error_of_a_fleet_without_messages(tmp_path, rows):
    with duckdb.connect() as connection:
        connection.execute(f"SET file_search_path='{tmp_path}'")
        for folder in ("out", "old", "new"):
            (tmp_path / folder).mkdir()
            assert [*write_table(str(tmp_path / folder / "facts.parquet"), rows)] == [*rows]
        values = [value for query in _QUERIES for row in connection.sql(query).fetchall() for value in row]
    assert not [value for value in values if isinstance(value, float) and isnan(value)]


@pytest.mark.parametrize(
    ("pattern", "places", "robots"),
    [
        ("{robot}/{day}/*.mcap", ["/data/r1/mon/a_1.mcap", "/data/r2/mon/c.mcap"], ["r1", "r2"]),
        ("/data/*/{robot}/*", ["/data/r1/mon/a_1.mcap", "/data/r1/tue/b_1.mcap"], ["mon", "tue"]),
        ("{robot}_*.mcap", ["/data/r1/a_1.mcap", "/data/c.mcap"], ["a", None]),
        ("/data/**/{robot}.mcap", ["/data/r1/mon/a_1.mcap", "/data/r2/c.mcap"], ["a_1", "c"]),
        ("/elsewhere/{robot}/**", ["/data/r1/a.mcap"], [None]),
        ("r?/{day}/{robot}.mcap", ["/data/r1/mon/a_1.mcap"], ["a_1"]),
        (None, ["/data/r1/a.mcap", "/data/r1/b.mcap"], [None, None]),
        (None, ["/data/r1/a.mcap", "/data/b.mcap"], ["r1", None]),
        (None, ["/data/r1/x/a.mcap", "/data/r1/y/c.mcap", "/data/r2/z.mcap"], ["r1", "r1", "r2"]),
        (None, ["s3://days/r1/a.mcap", "s3://days/r2/a.mcap"], ["r1", "r2"]),
        (None, ["/a.mcap", "s3://x/b.mcap"], ["", "s3:"]),
    ],
)
def test_a_robot_is_what_its_path_says(pattern, places, robots, tmp_path):
    with Ledger(tmp_path) as ledger:
        for place in places:
            ledger.append(Entry(result_name(place), State.FAILED, place, "analyze version:1", error="torn"))
        entries = [*ledger.entries.values()]
    rows = fleet_rows(str(tmp_path), entries, None if pattern is None else RobotPattern.parse(pattern))
    assert {row.recording: row.robot for row in rows} == dict(zip(places, robots, strict=True))


@pytest.mark.parametrize("pattern", ["*/*.mcap", "{robot}/{robot}", "", "{Robot}/*"])
def test_a_pattern_without_one_robot_is_refused(pattern):
    with pytest.raises(UsageError, match=r"expected \{robot\} once"):
        RobotPattern.parse(pattern)


def test_no_name_moves_a_cursor_begins_a_line_or_runs_off_the_screen():
    chance = random.Random(_SEED)

    def name() -> str:
        return hostile_name(chance)

    summary = Summary()
    for share in (None, 0.0, 0.3, 0.9):
        found = FindingFacts(code=name(), severity="warn", topic=name(), seconds=9, text=name(), suggestion=name())
        value = SuggestedValue(key=name(), topic=name(), value=name())
        row = FleetRow(
            recording=f"/{name()}/{name()}",
            robot=name(),
            error=name() if share is None else None,
            group_name=None if share is None else name(),
            share=share,
            findings=(found,),
            suggestions=(value,),
        )
        assert row.model_dump_json().isprintable()
        summary.take(row)
    lines = list(summary.lines())
    assert_shown_safely("\n".join(lines))
    assert max(map(len, lines)) <= 80
