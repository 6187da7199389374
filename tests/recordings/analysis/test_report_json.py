"""An analysis as JSON."""

import json

from syncrelay.recordings.analysis.report_json import as_json
from tests.recordings.analysis.html_reports import analyzed, drive


def test_it_has_the_spread_of_spans_and_latencies(tmp_path):
    analysis = analyzed(tmp_path, drive(seconds=10))
    (group,) = json.loads(json.dumps(as_json("drive", analysis)))["groups"]
    sets = analysis.groups[0].evaluation.sets
    for told, values in (
        (group["span"], sorted(each.span for each in sets)),
        (group["latency"], sorted(each.latency for each in sets)),
    ):
        assert (told["least"], told["greatest"]) == (values[0], values[-1])
        assert told["median"] == values[(len(values) + 1) // 2 - 1]
        assert len(values) == group["sets"] > 50


def test_without_a_set_there_is_neither_span_nor_latency(tmp_path):
    analysis = analyzed(tmp_path, drive(seconds=4), slop="1ns")
    (group,) = as_json("drive", analysis)["groups"]
    assert (group["sets"], group["span"], group["latency"]) == (0, None, None)
