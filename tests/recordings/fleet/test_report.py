"""What many recordings tell together: figures of robots, days, topics and groups, findings, suggested values."""

import json
import random
from copy import deepcopy

import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.cli.analysis_json import as_json
from syncrelay.errors import SyncRelayError, UsageError
from syncrelay.recordings.fleet import report as fleet_module
from syncrelay.recordings.fleet.cells import Cells
from syncrelay.recordings.fleet.documents import documents_in
from syncrelay.recordings.fleet.report import Failure, Fleet, fleet_report
from syncrelay.recordings.fleet.robots import RobotPattern
from syncrelay.recordings.fleet.suggestions import Gain
from tests.cli.html_reports import analyzed, drive
from tests.recordings.fleet.documents import (
    MAY_1,
    MS,
    SECOND,
    an_input,
    change,
    document,
    finding,
    group,
    quantity,
    topic,
)
from tests.recordings.fleet.documents import spread as a_spread

_DAY = 86_400 * SECOND


def _names(ranking) -> list[str | None]:
    return [row.name for row in ranking.rows]


def _figures(ranking, name):
    (found,) = [row.figures for row in ranking.rows if row.name == name]
    return found


@pytest.mark.parametrize(
    ("pattern", "robots"),
    [
        (None, {"r1": 2, "r2": 1}),
        ("{robot}/{day}/*.mcap", {"r1": 2, "r2": 1}),
        ("/data/*/{robot}/*", {"mon": 2, "tue": 1}),
        ("{robot}_*.mcap", {"a": 1, "b": 1, None: 1}),
        ("/data/**/{robot}.mcap", {"a_1": 1, "b_1": 1, "c": 1}),
        ("/elsewhere/{robot}/**", {None: 3}),
        ("r?/{day}/{robot}.mcap", {"a_1": 1, "b_1": 1, "c": 1}),
    ],
)
def test_a_robot_is_what_its_path_says(pattern, robots):
    places = ("/data/r1/mon/a_1.mcap", "/data/r1/tue/b_1.mcap", "/data/r2/mon/c.mcap")
    report = fleet_report(((place, document(group(9, 10))) for place in places), robot=pattern)
    assert {row.name: row.figures.recordings for row in report.by_robot.rows} == robots
    assert {each.name: each.robot for each in report.recordings}.keys() == set(places)
    assert sorted(str(each.robot) for each in report.recordings) == sorted(
        str(robot) for robot, count in robots.items() for _ in range(count)
    )


@pytest.mark.parametrize(
    ("places", "robots"),
    [
        (["/data/r1/a.mcap", "/data/r1/b.mcap"], {None: 2}),
        (["/data/r1/a.mcap", "/data/b.mcap"], {"r1": 1, None: 1}),
        (["/data/r1/x/a.mcap", "/data/r1/x/b.mcap", "/data/r1/y/c.mcap", "/data/r2/z.mcap"], {"r1": 3, "r2": 1}),
        (["s3://days/r1/a.mcap", "s3://days/r2/a.mcap"], {"r1": 1, "r2": 1}),
        (["/a.mcap", "s3://x/b.mcap"], {None: 2}),
        (["/data/r1/run/", "/data/r2/run"], {"r1": 1, "r2": 1}),
    ],
)
def test_without_a_pattern_a_robot_is_the_first_folder_below_the_common_one(places, robots):
    robots = {"": 1, "s3:": 1} if places[0] == "/a.mcap" else robots
    for order in (places, places[::-1]):
        report = fleet_report((place, document(group(9, 10))) for place in order)
        assert {row.name: row.figures.recordings for row in report.by_robot.rows} == robots


@pytest.mark.parametrize("pattern", ["*/*.mcap", "{robot}/{robot}", "", "{Robot}/*"])
def test_a_pattern_without_one_robot_is_refused(pattern):
    with pytest.raises(UsageError, match=r"expected \{robot\} once"):
        fleet_report((), robot=pattern)


def test_the_match_rate_is_the_mean_of_recordings_and_no_set_counts_as_none():
    report = fleet_report(
        [
            ("/r1/a", document(group(100, 100))),
            ("/r1/b", document(group(5, 10), begin=MAY_1 + _DAY)),
            ("/r2/a", document(group(0, 0, sets=0), begin=MAY_1 + _DAY)),
            ("/r3/a", document(group(0, 0, sets=7))),
        ]
    )
    assert [(row.name, row.figures.match_rate) for row in report.by_robot.rows] == [
        ("r2", 0),
        ("r1", 0.75),
        ("r3", None),
    ]
    assert [(row.name, row.figures.match_rate) for row in report.by_day.rows] == [
        ("2024-05-02", 0.25),
        ("2024-05-01", 1),
    ]
    whole = report.whole
    assert (whole.recordings, whole.judged, whole.without, whole.match_rate) == (4, 4, 1, 0.5)
    assert (whole.now, whole.possible, whole.sets) == (105, 110, 112)
    assert [each.name for each in report.recordings] == ["/r2/a", "/r1/b", "/r1/a", "/r3/a"]
    assert (report.begin, report.last_begin) == (MAY_1, MAY_1 + _DAY)


def test_spans_and_latencies_of_recordings_become_those_of_the_fleet():
    report = fleet_report(
        [
            ("/r1/a", document(group(3, 3, spans=[10 * MS, 20 * MS, 30 * MS], latencies=[1, 2, 3]))),
            ("/r2/a", document(group(2, 2, spans=[40 * MS, 500 * MS], latencies=[4, 5]))),
        ]
    )
    span, latency = report.whole.span, report.whole.latency
    assert span is not None
    assert latency is not None
    assert span.median == pytest.approx(30 * MS, rel=1 / 16)
    assert span.high == pytest.approx(500 * MS, rel=1 / 16)
    assert span.greatest == 500 * MS
    assert (latency.median, latency.high, latency.greatest) == (3, 5, 5)
    assert _figures(report.by_robot, "r2").span.median == pytest.approx(40 * MS, rel=1 / 16)


def test_clocks_and_drops_are_told_of_robots_groups_and_topics():
    topics = [
        topic("/camera", drift_ppm=-40.0, delay=a_spread(3 * MS, 9 * MS), gaps=2, longest_gap=SECOND),
        topic("/lidar", unstamped=4, out_of_order=1, delay=a_spread(-37 * SECOND, 40 * SECOND), drift_ppm=2.5),
    ]
    lost = [an_input("/camera", 8, {"too_far": 2}, unneeded=2), an_input("/lidar", 8, {"late": 1, "too_far": 3})]
    report = fleet_report([("/r1/a", document(group(8, 10, inputs=lost), topics=topics))])
    whole, camera, lidar = report.whole, _figures(report.by_topic, "/camera"), _figures(report.by_topic, "/lidar")
    for figures in (whole, _figures(report.by_group, "front")):
        assert figures.dropped == (("too_far", 5), ("late", 1))
        assert figures.faults == (("stamp 0", 4), ("out of order", 1))
        assert figures.drift is not None
        assert (figures.drift.ppm, figures.drift.topic, figures.drift.recording) == (-40.0, "/camera", "/r1/a")
        assert (figures.other_clock, figures.gaps, figures.longest_gap) == (1, 2, SECOND)
        assert (figures.received, figures.matched, figures.unneeded) == (22, 16, 2)
    assert (camera.match_rate, lidar.match_rate) == (1, pytest.approx(8 / 12, abs=1e-6))
    assert _names(report.by_topic) == ["/lidar", "/camera"]
    assert (lidar.other_clock, lidar.drift.ppm, lidar.latency) == (1, 2.5, None)
    assert camera.latency.greatest == 9 * MS
    assert camera.span.greatest == lidar.span.greatest == 2 * MS


def test_a_topic_of_two_groups_has_one_clock():
    both = (group(9, 10), group(9, 10, name="rear"))
    report = fleet_report([("/a", document(*both, topics=[topic("/camera", unstamped=4)]))])
    camera = _figures(report.by_topic, "/camera")
    assert report.whole.faults == camera.faults == (("stamp 0", 4),)
    assert (camera.recordings, camera.judged, report.whole.judged) == (1, 2, 2)


def test_a_finding_is_told_with_the_values_suggested_where_it_was_found_and_what_they_give():
    wider, widest, longer = change("slop", "6ms"), change("slop", "9ms"), change("min_period", "84ms", 1)
    report = fleet_report(
        [
            ("/a", document(group(50, 100, wider, longer, then=99, findings=[finding("over_slop", 30)]))),
            ("/b", document(group(40, 100, wider, then=90, findings=[finding("over_slop", 50)]))),
            ("/c", document(group(10, 100, widest, then=80, findings=[finding("over_slop", 5, severity="error")]))),
            ("/d", document(group(99, 100, findings=[finding("over_slop", 4), finding("gaps", 99, about=1)]))),
            ("/e", document(group(98, 100, widest, then=100))),
        ]
    )
    first, second = report.findings
    assert (first.code, first.where.group, first.where.topic) == ("over_slop", "front", "")
    assert (first.severity, first.recordings, first.seconds) == ("error", 4, 89)
    assert (first.text, first.advice, first.example) == ("over_slop for 50 s", "mend `over_slop`", "/b")
    assert [(each.value.where.topic, each.value.written, each.gain) for each in first.values] == [
        ("", "slop: 6ms", Gain(2, 90, 189, 200)),
        ("", "slop: 9ms", Gain(1, 10, 80, 100)),
        ("/lidar", "min_period: 84ms", Gain(1, 50, 99, 100)),
    ]
    assert first.gain == Gain(recordings=3, now=100, then=269, possible=300)
    assert (second.code, second.where.topic, second.values, second.gain) == ("gaps", "/lidar", (), Gain(0, 0, 0, 0))
    assert [(each.value.written, each.gain) for each in report.whole.values] == [
        ("slop: 6ms", Gain(2, 90, 189, 200)),
        ("slop: 9ms", Gain(2, 108, 180, 200)),
        ("min_period: 84ms", Gain(1, 50, 99, 100)),
    ]
    assert report.whole.gain == Gain(4, 198, 369, 400)
    lidar = _figures(report.by_topic, "/lidar")
    assert [(each.value.written, each.gain.recordings) for each in lidar.values] == [("min_period: 84ms", 1)]
    assert _figures(report.by_topic, "/camera").gain == Gain(0, 0, 0, 0)
    assert report.whole.codes == (("over_slop", 4), ("gaps", 1))
    assert _figures(report.by_topic, "/lidar").codes == (("gaps", 1),)
    assert _figures(report.by_topic, "/camera").codes == ()


def _of_group(**told):
    return document({**group(9, 10), **told})


@pytest.mark.parametrize(
    ("spoilt", "why"),
    [
        (None, "the document: Input should be a valid dictionary"),
        ({"groups": [group(9, 10)]}, "begin: Field required"),
        (document(), "no group was analyzed: name the file with --config FILE"),
        (_of_group(sets=-1), "groups.0.sets: Input should be greater than or equal to 0"),
        (
            document(group(9, 10), topics=[topic("/a", drift_ppm=float("nan"))]),
            "topics.0.drift_ppm: Input should be a fin",
        ),
        (_of_group(findings=[finding("x", about=2)]), "names an input that the group does not have"),
        (
            _of_group(span={**(quantity(list(range(10))) or {}), "counts": dict.fromkeys(range(9000), 1)}),
            "at most 1100 items",
        ),
        ({**document(group(9, 10)), "begin": 10**40}, "begin: Input should be less than or equal to"),
    ],
)
def test_a_document_that_is_no_analysis_is_a_failure_and_the_others_count(spoilt, why):
    report = fleet_report([("/bad", spoilt), ("/good", document(group(9, 10)))], failed=[Failure("/gone", "torn")])
    assert (report.failed, report.whole.recordings) == (2, 1)
    bad, gone = report.failures
    assert bad.name == "/bad"
    assert why in bad.why
    assert gone == Failure("/gone", "torn")


@pytest.mark.parametrize("begin", [-(2**63), 2**63 - 1])
def test_a_time_of_another_century_has_a_day_or_none(begin):
    report = fleet_report([("/a", document(group(9, 10), begin=begin, lasts=0))])
    assert _names(report.by_day) == [{-(2**63): "1677-09-21", 2**63 - 1: "2262-04-11"}[begin]]


def test_an_older_document_without_spans_is_read():
    older = group(9, 10)
    del older["span"], older["latency"]
    report = fleet_report([("/a", document(older))])
    assert (report.whole.span, report.whole.match_rate) == (None, 0.9)


def test_a_real_analysis_is_a_document(tmp_path):
    analysis = analyzed(tmp_path, drive(seconds=10))
    told = json.loads(json.dumps(as_json("/fleet/r1/drive.mcap", analysis)))
    report = fleet_report([("/fleet/r1/drive.mcap", told)])
    sets = analysis.groups[0].evaluation.sets
    assert report.failed == 0
    assert report.whole.sets == len(sets)
    assert report.whole.span is not None
    assert report.whole.span.greatest == max(each.span for each in sets)
    assert report.whole.match_rate == pytest.approx(analysis.groups[0].suggestion.now / 100, rel=0.02)
    assert {each.code for each in report.findings} == {
        lasting.finding.code.value for lasting in analysis.groups[0].findings
    }


def test_the_documents_in_a_folder_are_those_of_its_results(tmp_path):
    told = {**document(group(9, 10)), "recording": "/fleet/r1/a.mcap"}
    for name, text in {"a-1": json.dumps(told), "b-2": "{", "c-3": None, ".partial": json.dumps(told)}.items():
        (tmp_path / name).mkdir()
        if text is not None:
            (tmp_path / name / "analysis.json").write_text(text)
    (tmp_path / "_ledger.jsonl").write_text("{}\n")
    assert list(documents_in(tmp_path)) == [("/fleet/r1/a.mcap", told), (str(tmp_path / "b-2" / "analysis.json"), None)]
    with pytest.raises(SyncRelayError, match="none: cannot be read: No such file"):
        list(documents_in(tmp_path / "none"))


def test_too_many_robots_are_not_told_apart_but_counted(monkeypatch):
    monkeypatch.setattr(Cells.__init__, "__defaults__", (3,))
    many = [(f"/data/r{number}/a.mcap", document(group(9, 10))) for number in range(4)]
    report = fleet_report(many)
    assert (report.by_robot.is_told, report.by_robot.rows, report.whole.recordings) == (False, (), 4)
    assert report.by_day.is_told
    # With one that lies elsewhere, all of them lie in one folder below the common one.
    report = fleet_report([*many, ("/other/a.mcap", document(group(9, 10)))])
    assert {row.name: row.figures.recordings for row in report.by_robot.rows} == {"data": 4, "other": 1}


def test_of_very_many_recordings_the_worst_are_listed(monkeypatch):
    monkeypatch.setattr(fleet_module, "MOST_RECORDINGS", 5)
    order = list(range(100))
    random.Random(0).shuffle(order)
    report = fleet_report((f"/r/{now:03}", document(group(now, 100))) for now in order)
    assert [each.name for each in report.recordings] == [f"/r/{now:03}" for now in range(5)]
    assert report.whole.recordings == 100


@st.composite
def _documents(draw):
    """A recording as it may be, and its path."""
    place = "/".join(draw(st.lists(st.sampled_from(["", "a", "b", "c.mcap"]), max_size=4)))
    if draw(st.integers(0, 9)) == 0:
        return place, draw(st.sampled_from([None, {}, [], "x"]))
    counts, times = st.integers(0, 50), st.integers(-(2**40), 2**40)
    groups = []
    for name in draw(st.lists(st.sampled_from(["front", "rear"]), min_size=1, max_size=2, unique=True)):
        now, more = draw(counts), draw(counts)
        codes = draw(st.lists(st.sampled_from(["over_slop", "silent"]), max_size=3))
        changes = draw(st.lists(st.sampled_from([change("slop", "6ms"), change("queue_size", 7), change("slop", 5)])))
        made = group(
            now,
            now + more,
            *changes,
            name=name,
            then=now + draw(counts),
            findings=[finding(code, draw(counts), about=draw(st.sampled_from([None, 0, 1]))) for code in codes],
            spans=draw(st.lists(times, min_size=now, max_size=now)),
        )
        groups.append(made)
    clock = topic("/camera", drift_ppm=draw(st.none() | st.floats(-99, 99)), unstamped=draw(counts))
    begin = draw(st.sampled_from([0, MAY_1, MAY_1 + _DAY, -(2**63)]))
    return place, document(*groups, begin=begin, topics=[clock])


@pytest.mark.parametrize("pattern", [None, "{robot}/*"])
@given(parts=st.lists(st.lists(_documents(), max_size=5), max_size=4), data=st.data())
def test_parts_in_any_order_give_the_report_of_the_whole(pattern, parts, data):
    def fleet(documents):
        taken = Fleet(None if pattern is None else RobotPattern.parse(pattern))
        for name, told in documents:
            taken.take(name, deepcopy(told))
        return taken

    # Each recording is another file.
    parts = [
        [(f"{name}/{number}.{at}", told) for at, (name, told) in enumerate(part)] for number, part in enumerate(parts)
    ]
    whole = [each for part in parts for each in part]
    expected = fleet(whole).report()
    assert fleet(data.draw(st.permutations(whole))).report() == expected
    merged = fleet([])
    for part in data.draw(st.permutations(parts)):
        merged.add(fleet(part))
    assert merged.report() == expected
    assert sum(row.figures.recordings for row in expected.by_robot.rows) == expected.whole.recordings
    assert expected.whole.recordings + expected.failed == len(whole)
