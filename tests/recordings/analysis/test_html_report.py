"""The page of an analysis: what it holds, adds up and leaves out. How a browser shows it: test_html_browser.py."""

import json
import re
from dataclasses import replace
from html import escape

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.recordings.analysis.html import as_html, document
from syncrelay.recordings.analysis.html.drawings import pack
from syncrelay.recordings.analysis.html.lanes import Lanes, lanes_of
from syncrelay.status.fates import CODES, FATES, MATCHED, UNNEEDED
from syncrelay.sync import DropReason
from tests.cli.command import run_here
from tests.recordings.analysis.html_reports import analyzed, drawings_in, drive, of_device, unpacked
from tests.recordings.bag.making import rig, rig_file, write_mcap
from tests.ros.cdr_messages import VECTOR, vector
from tests.ros.configs import inputs

_SECOND = 1_000_000_000
_NEVER = 10**9
_MOST = document._MOST_MESSAGES  # noqa: SLF001  as it is before a test sets another


@pytest.fixture(scope="module")
def analysis(tmp_path_factory):
    return analyzed(tmp_path_factory.mktemp("html"), drive(seconds=30))


def _lanes(analysis, *, most: int = _NEVER) -> Lanes:
    return lanes_of(analysis.groups[0], analysis.begin, most=most)


def _counts(lanes: Lanes) -> list[dict[str, int]]:
    return [
        {fate.name: count for code, fate in enumerate(FATES) if (count := int(np.count_nonzero(lane.fates == code)))}
        for lane in lanes.lanes
    ]


@given(st.lists(st.integers(min_value=-(2**62), max_value=2**62)), st.integers(min_value=0, max_value=10**9))
def test_what_is_packed_comes_out_again(values, step):
    rising = np.cumsum(np.full(50, step, dtype=np.int64))
    assert unpacked(pack(rising)) == rising.tolist()
    far = pack(np.array(values, dtype=np.int64))
    assert unpacked(far) == [value // far["unit"] * far["unit"] for value in values]


def test_every_reason_has_a_shape_of_its_own():
    assert set(CODES) == {MATCHED, UNNEEDED, *(reason.value for reason in DropReason)}
    assert len({(fate.path, fate.is_filled) for fate in FATES}) == len(FATES)


def test_every_message_stands_in_its_lane_with_its_fate(analysis):
    counts = _counts(_lanes(analysis))
    for each, of_input in zip(analysis.groups[0].fates, counts, strict=True):
        expected = {reason.value: count for reason, count in each.dropped.items()}
        of_input.setdefault(UNNEEDED, 0)
        assert of_input == {MATCHED: each.matched, UNNEEDED: each.unneeded, **expected}
        assert sum(of_input.values()) == each.received
    assert counts[2][UNNEEDED] > 1000


def test_a_line_joins_the_messages_of_a_set(analysis):
    lanes = _lanes(analysis)
    columns = zip(lanes.lanes, lanes.members.T, strict=True)
    times = np.stack([lane.times[places] for lane, places in columns], axis=1)
    assert (np.max(times, axis=1) - np.min(times, axis=1)).tolist() == lanes.spans.tolist()
    for lane, places in zip(lanes.lanes, lanes.members.T, strict=True):
        assert set(lane.fates[places].tolist()) == {CODES[MATCHED]}
    assert len(lanes.spans) == len(analysis.groups[0].evaluation.sets)


def test_a_message_that_serves_many_sets_stands_in_its_lane_once(tmp_path):
    analysis = analyzed(tmp_path, drive(seconds=10), policy="latest_time", trigger="/imu", slop=None)
    lanes, counts = _lanes(analysis), analysis.groups[0].evaluation.counts
    assert [each[MATCHED] for each in _counts(lanes)] == [each.matched for each in counts]
    assert len(lanes.members) > 4 * counts[0].matched


def test_a_set_without_an_optional_input_joins_the_others(tmp_path):
    frames = [frame for frame in drive(seconds=10) if frame.topic != "/imu"]
    topics = inputs(dict.fromkeys(("/camera", "/lidar"), VECTOR))
    topics.append({"topic": "/imu", "type": VECTOR, "required": False})
    lanes = _lanes(analyzed(tmp_path, frames, topics=topics, max_wait="10ms"))
    assert len(lanes.members) > 50
    assert set(lanes.members[:, 2].tolist()) == {-1}
    assert len(lanes.lanes[2].times) == 0


def test_unset_stamps_stand_where_they_were_received(tmp_path):
    frames = [
        frame._replace(payload=vector(0)) if frame.topic == "/imu" and number % 2 else frame
        for number, frame in enumerate(drive(seconds=10))
    ]
    analysis = analyzed(tmp_path, frames)
    lanes = _lanes(analysis)
    assert lanes.astray == sum(1 for frame in frames if frame.payload == vector(0))
    assert lanes.lanes[2].times[0] >= -_SECOND
    assert lanes.lanes[2].times[-1] <= analysis.end - analysis.begin + _SECOND
    assert "drawn at the time of receipt" in as_html("rig", analysis)


def test_what_is_too_much_is_thinned_by_whole_stretches(tmp_path):
    frames = drive(seconds=120, slow_down=5)
    analysis = analyzed(tmp_path, frames)
    whole, thinned = _lanes(analysis), _lanes(analysis, most=len(frames) // 4)
    assert (whole.each, thinned.each) == (1, 4)
    sets = zip(whole.begins.tolist(), whole.spans.tolist(), strict=True)
    kept = [each for each in sets if each[0] // whole.stretch % thinned.each == 0]
    assert list(zip(thinned.begins.tolist(), thinned.spans.tolist(), strict=True)) == kept
    for lane, places in zip(thinned.lanes, thinned.members.T, strict=True):
        assert set(lane.fates[places].tolist()) == {CODES[MATCHED]}


def test_the_page_says_what_was_thinned_and_its_tables_are_of_all(analysis, monkeypatch):
    whole = as_html("rig", analysis)
    monkeypatch.setattr(document, "_MOST_MESSAGES", 500)
    thinned = as_html("rig", analysis)
    assert "more messages than the page can hold" not in whole
    assert "one of every 5 stretches of 10 s is drawn" in thinned
    tables = [re.findall(r"<table.*?</table>", page, re.DOTALL) for page in (whole, thinned)]
    assert tables[0] == tables[1]


def test_a_page_of_all_that_it_can_hold_stays_below_6_mb(analysis, monkeypatch):
    whole = as_html("rig", analysis)
    monkeypatch.setattr(document, "_MOST_MESSAGES", 1)
    bare = as_html("rig", analysis)
    lanes = [drawings_in(page)["groups"][0]["timeline"]["lanes"] for page in (whole, bare)]
    drawn, left = (sum(lane["times"]["count"] for lane in each) for each in lanes)
    assert drawn == sum(topic.messages for topic in analysis.topics)
    assert len(whole) - len(bare) < 10 * (drawn - left)
    assert len(bare) + 10 * _MOST < 6_000_000


def test_the_page_says_so_where_the_better_file_cannot_be_written(analysis):
    fused = json.dumps(json.loads(analysis.text)["groups"]["fused"])
    shared = f"{{version: 1, groups: {{fused: &fused {fused}, other: {{<<: *fused , output_prefix: /other}}}}}}"
    assert analysis.changes
    assert "write them by hand" not in as_html("drive", analysis)
    assert "write them by hand" in as_html("drive", replace(analysis, text=shared))


def test_what_is_found_of_several_inputs_is_one_note(tmp_path):
    frames = drive(seconds=20)
    end = frames[0].time + 8 * _SECOND
    page = as_html("x", analyzed(tmp_path, [each for each in frames if each.topic == "/camera" or each.time < end]))
    notes = re.findall(r'<li class="note.*?</li>\n', page, re.DOTALL)
    (silent,) = [each for each in notes if "<summary>likewise /imu</summary>" in each]
    assert silent.count("(for ") == 2


def test_nothing_is_fetched_from_anywhere(analysis):
    page = as_html("rig", analysis)
    assert not re.findall(r'(?:src|href|action|data)="(?!#)', page)
    assert not re.findall(r"@import|url\((?!#)|fetch\(|XMLHttpRequest|WebSocket", page)
    assert "default-src 'none'" in page


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("command")
    (made / "f.yaml").write_text(rig_file(slop="1ms"))
    write_mcap(made / "rig.mcap", rig(100))
    return made


def test_the_command_writes_it_beside_what_it_prints(folder):
    plain = run_here("analyze", "rig.mcap", "--config", "f.yaml", "--json", folder=folder)
    done = run_here("analyze", "rig.mcap", "--config", "f.yaml", "--json", "--html", "report.html", folder=folder)
    assert (done.returncode, done.stderr) == (0, "syncrelay: wrote report.html\n")
    assert done.stdout == plain.stdout
    assert (folder / "report.html").read_text().startswith("<!doctype html>")


def test_a_former_report_is_replaced_and_nothing_else_is(folder):
    (folder / "again.html").write_text(_FORMER)
    done = run_here("analyze", "rig.mcap", "--config", "f.yaml", "--html", "again.html", folder=folder)
    assert (done.returncode, done.stderr) == (0, "syncrelay: wrote again.html\n")
    (folder / "mine.html").write_text("<!doctype html><title>mine</title>")
    done = run_here("analyze", "rig.mcap", "--config", "f.yaml", "--html", "mine.html", folder=folder)
    assert (done.returncode, done.stderr) == (1, "syncrelay: mine.html: already exists and is not overwritten\n")
    assert (folder / "mine.html").read_text() == "<!doctype html><title>mine</title>"


_FORMER = '<!doctype html>\n<html lang="en">\n<head>\n<meta name="generator" content="syncrelay">\nformer'


def test_topics_without_a_file_are_drawn_too(folder):
    done = run_here("analyze", "rig.mcap", "/camera", "/lidar", "--html", "topics.html", folder=folder)
    assert done.returncode == 0
    page = (folder / "topics.html").read_text()
    assert "100 of 100 possible sets come together" in page
    text = done.stdout.partition("A file that gives these sets:\n\n")[2]
    assert escape(text.rstrip()) in page


def test_the_line_that_a_device_was_mapped_by_lies_on_its_quickest_messages_and_begins_anew_where_its_clock_was_set(
    tmp_path,
):
    page = as_html("drive.mcap", of_device(tmp_path, seconds=60))
    ((mapping,),) = [group["mappings"] for group in drawings_in(page)["groups"]]
    times, stamps, line = (np.array(unpacked(mapping[key])) for key in ("times", "stamps", "line"))
    ((step, by),), (begin,) = mapping["steps"], mapping["begins"]
    assert len(times) == len(stamps) == len(line) == 600
    assert times[begin - 1] < step <= times[begin]
    assert round(by / _SECOND) == -3
    assert np.all(stamps <= line)
    for of in (slice(100, begin - 20), slice(begin + 20, None)):
        assert np.quantile(line[of] - stamps[of], 0.05) < 1_000_000
        # As the clock runs slow, its stamps fall behind, by 200 us a second, and the middle of the line is at 0.
        slope = np.polyfit(times[of] / _SECOND, line[of] / 1000, 1)[0]
        assert abs(slope + 200) < 20
        assert line[of].max() > 0 > line[of].min()
    assert "/lidar is mapped to the host" in page
    assert "Stamps mapped" not in as_html("drive.mcap", analyzed(tmp_path, drive(seconds=4)))
