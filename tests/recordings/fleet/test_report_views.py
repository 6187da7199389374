"""A fleet's report as text, as JSON and as a page. How a browser shows the page: test_report_browser.py."""

import gzip
import json
import random
import re
import tracemalloc
from base64 import b64decode
from dataclasses import asdict

import pytest

from syncrelay.cli.fleet_html import MARK, fleet_as_html
from syncrelay.cli.fleet_json import fleet_as_json
from syncrelay.cli.fleet_text import fleet_lines
from syncrelay.recordings.fleet import report as fleet_module
from syncrelay.recordings.fleet.report import Failure, Fleet, fleet_report
from tests.hostile_names import FORGED, assert_shown_safely, hostile_name
from tests.recordings.fleet.documents import MAY_1, MS, SECOND, an_input, change, document, finding, fleet, group, topic

_MOST_BYTES = 6_000_000


def _packed(page: str) -> dict[str, list]:
    """The rows that a page hands to its script."""
    (told,) = re.findall(r'<script type="application/json" id="rows">(.*?)</script>', page, re.DOTALL)
    return json.loads(gzip.decompress(b64decode(json.loads(told))))


@pytest.fixture(scope="module")
def report():
    return fleet_report(fleet(400), failed=[Failure("/data/x.mcap", "/data/x.mcap: is cut off at 3 MB")])


def _small():
    lost = [an_input("/camera", 8, {"too_far": 2}, unneeded=2), an_input("/lidar", 8, {"late": 1, "too_far": 3})]
    wider = change("slop", "6ms")
    found = [finding("over_slop", 30), finding("silent", 9, severity="error", about=1)]
    first = group(8, 10, wider, then=10, inputs=lost, findings=found, spans=[2 * MS] * 8, latencies=[MS] * 8)
    clock = topic("/lidar", drift_ppm=-37.5, unstamped=4, gaps=2, longest_gap=SECOND)
    return fleet_report(
        [
            ("/fleet/r1/a.mcap", document(first, topics=[topic("/camera"), clock])),
            ("/fleet/r2/b.mcap", document(group(0, 0, sets=0, inputs=[an_input("/camera", 0), an_input("/lidar", 0)]))),
        ]
    )


def test_the_text_says_what_is_so_the_worst_first():
    assert "\n".join(fleet_lines(_small())) == _SMALL.rstrip("\n")


def test_no_line_is_wider_than_80_characters_and_the_rest_is_counted(report):
    lines = list(fleet_lines(report))
    assert max(map(len, lines)) <= 80
    assert "robots, by the first folder below /data/fleet (worst 10 of 40)" in lines
    assert "recordings (worst 10 of 400)" in lines
    assert lines[-1] == "  and 390 more"
    robots = [line for line in lines if re.match(r"  robot_\d\d: 10 recordings", line)]
    assert len(robots) == 10
    assert robots[0] == "  robot_03: 10 recordings"
    assert "not analyzed: 1 recording" in lines


def test_the_json_has_the_figures_of_the_report(report):
    told = json.loads(json.dumps(fleet_as_json(report)))
    assert (told["recordings"], told["failed"]) == (400, 1)
    assert [row["robot"] for row in told["by_robot"]] == [row.name for row in report.by_robot.rows]
    worst, figures = told["by_robot"][0], report.by_robot.rows[0].figures
    assert (worst["robot"], worst["match_rate"]) == ("robot_03", figures.match_rate)
    assert worst["codes"] == dict(figures.codes)
    assert worst["span"] == asdict(figures.span)
    drift = next(row for row in told["by_topic"] if row["topic"] == "/lidar")["drift"]
    assert 39 < drift["ppm"] < 40
    assert "/robot_07/" in drift["recording"]
    first = told["findings"][0]
    assert (first["code"], first["group"], first["topic"]) == ("over_slop", "front", None)
    assert {each["value"] for each in first["values"]} == {"6ms", "7ms", "9ms"}
    assert first["gain"]["recordings"] == sum(each["recordings"] for each in first["values"]) == first["recordings"]
    assert told["failures"] == [{"name": "/data/x.mcap", "why": "/data/x.mcap: is cut off at 3 MB"}]
    assert len(told["worst_recordings"]) == 400


def test_the_page_holds_every_row_and_the_worst_ones_without_a_script(report):
    page = fleet_as_html(report)
    rows = _packed(page)
    assert MARK in page[:500]
    assert [row[2] for row in rows["robots"]] == [row.name for row in report.by_robot.rows]
    assert [row[2] for row in rows["recordings"]] == [
        each.name.removeprefix("/data/fleet/") for each in report.recordings
    ]
    (table,) = re.findall(r'data-table="robots".*?</table>', page, re.DOTALL)
    assert re.findall(r'<th scope="row"[^>]*>(.*?)</th>', table) == [row.name for row in report.by_robot.rows[:10]]
    assert "/data/x.mcap: is cut off at 3 MB" in page
    assert page == fleet_as_html(report)


def test_ten_thousand_recordings_are_a_page_below_6_mb():
    report = fleet_report(fleet(10_000))
    page = fleet_as_html(report)
    rows = _packed(page)
    assert len(rows["recordings"]) == 10_000
    assert len(page.encode()) < _MOST_BYTES
    assert "are listed" not in page
    assert report.by_robot.rows[0].name == "robot_03"


def test_names_that_leave_no_room_are_told_as_far_as_they_fit():
    chance = random.Random(1)
    names = ["".join(chr(chance.randrange(0x4E00, 0x9FFF)) for _ in range(900)) for _ in range(60)]
    report = fleet_report((f"/r/{name}.mcap", document(group(9, 10))) for name in names)
    page = fleet_as_html(report, most_packed=40_000)
    kept = _packed(page)["recordings"]
    assert 0 < len(kept) < 60
    assert f"The worst {len(kept)} of 60 are listed." in page
    assert len(page) < 40_000 + 60_000


def test_memory_does_not_grow_with_the_number_of_recordings(monkeypatch):
    monkeypatch.setattr(fleet_module, "MOST_RECORDINGS", 50)
    taken, sizes = Fleet(None), []
    tracemalloc.start()
    try:
        for number, (name, told) in enumerate(fleet(600, days=3)):
            # All robots and days have come once before the first look.
            taken.take(name, told)
            if number in (299, 599):
                sizes.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    assert sizes[1] < sizes[0] + 100_000


def test_no_name_moves_a_cursor_begins_a_line_or_runs():
    chance = random.Random(7)

    def name():
        return hostile_name(chance)

    hostile: list[tuple[str, dict | None]] = []
    for _ in range(5):
        topics = (name(), name())
        told = finding(name(), 9, about=0)
        told.update(text=name(), suggestion=name())
        made = group(9, 10, change(name(), name(), 1), name=name(), topics=topics, findings=[told])
        made["inputs"][0]["dropped"] = {name(): 4}
        clocks = [topic(topics[0], drift_ppm=30.0, unstamped=2)]
        hostile.append((f"/{name()}/{name()}.mcap", document(made, topics=clocks, begin=MAY_1)))
    hostile.append((name(), None))
    report = fleet_report(hostile, failed=[Failure(name(), name())])
    text = "\n".join(fleet_lines(report))
    assert FORGED in text
    assert_shown_safely(text)
    assert max(map(len, text.split("\n"))) <= 80
    page = fleet_as_html(report)
    assert "<img" not in page
    assert page.count("<script") == page.count("</script") == 2
    assert not [each for each in page if not each.isprintable() and each != "\n"]
    for rows in _packed(page).values():
        assert all(cell.isprintable() for row in rows for cell in row[2:])


_SMALL = """\
2 recordings, 2 robots, 20 s in all, begun on 2024-05-01
  match rate: 40 %, 8 of 10 possible sets
  span: median 2 ms, 95 % within 2 ms, at most 2 ms
  latency: median 1 ms, 95 % within 1 ms, at most 1 ms
  clocks: largest drift -37.5 ppm (/lidar), stamp 0: 4 messages
  dropped: too_far 5, late 1 (2 of these not needed)
  findings: over_slop 1, silent 1 (recordings)

Worst first: the lowest match rate, then the most recordings with findings, then
  the name. A match rate is the mean of the shares of possible sets that came
  together, one for each recording and group; a group without a set counts as
  0 %. That of a topic is the share of its needed messages that went into sets.

findings, errors first, then those of most recordings
  error silent of front, /lidar: in 1 recording, for 9 s in all
    longest in /fleet/r1/a.mcap: silent for 9 s; mend `silent`
    suggested there: `slop: 6ms` for 1 recording; 8 -> 10 of 10 possible sets
  warn over_slop of front: in 1 recording, for 30 s in all
    longest in /fleet/r1/a.mcap: over_slop for 30 s; mend `over_slop`
    suggested there: `slop: 6ms` for 1 recording; 8 -> 10 of 10 possible sets

suggested values, those for most recordings first; each recording with all of
  its own
  front: `slop: 6ms` for 1 recording: 8 -> 10 of 10 possible sets

groups
  front: 2 recordings, 1 time without a set
    match rate: 40 %, 8 of 10 possible sets
    span: median 2 ms, 95 % within 2 ms, at most 2 ms
    latency: median 1 ms, 95 % within 1 ms, at most 1 ms
    clocks: largest drift -37.5 ppm (/lidar), stamp 0: 4 messages
    dropped: too_far 5, late 1 (2 of these not needed)
    findings: over_slop 1, silent 1 (recordings)
    suggested: `slop: 6ms` for 1 recording; 8 -> 10 of 10 possible sets

robots, by the first folder below /fleet
  r2: 1 recording, 1 time without a set
    match rate: 0 %, 0 sets
  r1: 1 recording
    match rate: 80 %, 8 of 10 possible sets
    span: median 2 ms, 95 % within 2 ms, at most 2 ms
    latency: median 1 ms, 95 % within 1 ms, at most 1 ms
    clocks: largest drift -37.5 ppm (/lidar), stamp 0: 4 messages
    dropped: too_far 5, late 1 (2 of these not needed)
    findings: over_slop 1, silent 1 (recordings)
    suggested: `slop: 6ms` for 1 recording; 8 -> 10 of 10 possible sets

topics
  /lidar: 2 recordings, 1 time without a message
    match rate: 33 %, 8 of 12 needed messages in sets
    distance: to the nearest of the others median 1.02 ms, at most 2 ms
    gaps: 2, longest 1 s
    clocks: largest drift -37.5 ppm (/lidar), stamp 0: 4 messages
    dropped: too_far 3, late 1
    findings: silent 1 (recordings)
  /camera: 2 recordings, 1 time without a message
    match rate: 50 %, 8 of 8 needed messages in sets
    distance: to the nearest of the others median 1.02 ms, at most 2 ms
    dropped: too_far 2 (2 of these not needed)

days, in UTC
  2024-05-01: 2 recordings, 1 time without a set
    match rate: 40 %, 8 of 10 possible sets
    span: median 2 ms, 95 % within 2 ms, at most 2 ms
    latency: median 1 ms, 95 % within 1 ms, at most 1 ms
    clocks: largest drift -37.5 ppm (/lidar), stamp 0: 4 messages
    dropped: too_far 5, late 1 (2 of these not needed)
    findings: over_slop 1, silent 1 (recordings)
    suggested: `slop: 6ms` for 1 recording; 8 -> 10 of 10 possible sets

recordings
  /fleet/r2/b.mcap: 0 %, 0 sets
  /fleet/r1/a.mcap: 80 %, 8 of 10 possible sets; over_slop, silent
"""
