"""An analysis as JSON."""

import json
import re

from syncrelay.recordings.analysis.report_json import as_json
from syncrelay.recordings.analysis.report_text import report
from tests.recordings.analysis.html_reports import analyzed, drive, of_device
from tests.ros.streams import BEGIN, MS


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


def test_of_an_input_that_was_mapped_it_has_the_offset_the_rate_the_restarts_and_the_delay_as_the_text_does(tmp_path):
    analysis = of_device(tmp_path, seconds=60)
    (group,) = json.loads(json.dumps(as_json("drive", analysis)))["groups"]
    (mapped,) = group["mapped"]
    (restart,) = mapped["restarts"]
    # The line of the last half minute, and the least delay, which nothing tells from the clock.
    assert abs(mapped["offset"] - (3000 + 60_000 * 200e-6 + 6) * MS) < MS
    assert abs(mapped["rate_ppm"] - 200) < 20
    assert abs(restart["at"] - BEGIN - 30_000 * MS) < 1000 * MS
    assert abs(restart["by"] + 3000 * MS) < 10 * MS
    assert (mapped["topic"], mapped["delay"]) == ("/lidar", 5 * MS)
    line = r"its clock runs \d+ ppm slow, 3\.0\d s behind; set 1 time, back by 3 s; 5 ms of its least delay taken off"
    assert re.search(
        rf"^  /lidar is mapped to the host's time: {line}$", "\n".join(report("drive", analysis)), re.MULTILINE
    )


def test_of_inputs_of_the_hosts_time_it_has_no_mapping(tmp_path):
    analysis = analyzed(tmp_path, drive(seconds=4))
    assert as_json("drive", analysis)["groups"][0]["mapped"] == []
    assert "mapped" not in "\n".join(report("drive", analysis))
