"""Buckets that are the same for every recording."""

import json

from hypothesis import given
from hypothesis import strategies as st

from syncrelay.recordings.analysis.buckets import counted_in_buckets, floor_of, middle_of
from syncrelay.recordings.analysis.report_json import as_json
from tests.recordings.analysis.html_reports import analyzed, drive

_ANY = st.integers(min_value=-(2**63), max_value=2**63 - 1)


def test_small_numbers_have_a_bucket_each_and_larger_ones_share_it():
    assert [floor_of(value) for value in range(21)] == [*range(16), 16, 16, 18, 18, 20]
    assert [floor_of(value) for value in (-7, -17, 5_948_403)] == [-7, -16, 5_767_168]


@given(_ANY)
def test_the_middle_of_a_bucket_is_within_a_sixteenth_of_all_that_is_in_it(value):
    floor = floor_of(value)
    assert abs(middle_of(floor) - value) <= abs(value) / 16 + 1
    assert floor_of(floor) == floor_of(middle_of(floor)) == floor


@given(_ANY, _ANY)
def test_a_larger_number_is_in_no_lower_bucket(one, other):
    assert (floor_of(min(one, other))) <= floor_of(max(one, other))


@given(st.lists(_ANY), st.lists(_ANY))
def test_counts_of_two_recordings_add_up_to_those_of_both(first, second):
    both, one, other = (counted_in_buckets(values) for values in ([*first, *second], first, second))
    assert both == {floor: one.get(floor, 0) + other.get(floor, 0) for floor in sorted({*one, *other})}


def test_the_json_of_an_analysis_counts_spans_and_latencies(tmp_path):
    analysis = analyzed(tmp_path, drive(seconds=10))
    (group,) = json.loads(json.dumps(as_json("drive", analysis)))["groups"]
    sets = analysis.groups[0].evaluation.sets
    for told, values in (
        (group["span"], sorted(each.span for each in sets)),
        (group["latency"], sorted(each.latency for each in sets)),
    ):
        assert (told["least"], told["greatest"]) == (values[0], values[-1])
        assert told["median"] == values[(len(values) + 1) // 2 - 1]
        assert {int(floor): count for floor, count in told["counts"].items()} == counted_in_buckets(values)
        assert sum(told["counts"].values()) == group["sets"] > 50


def test_without_a_set_there_is_neither_span_nor_latency(tmp_path):
    analysis = analyzed(tmp_path, drive(seconds=4), slop="1ns")
    (group,) = as_json("drive", analysis)["groups"]
    assert (group["sets"], group["span"], group["latency"]) == (0, None, None)
