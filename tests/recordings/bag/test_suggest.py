"""What the analysis suggests, on streams of which all is known."""

import random
from array import array
from itertools import accumulate

import pytest

from syncrelay.recordings.analysis.analysis import group_of
from syncrelay.recordings.analysis.changes import with_changes
from syncrelay.recordings.analysis.evaluation import evaluate
from syncrelay.recordings.analysis.suggest import possible_sets, suggest
from tests.recordings.bag.made_streams import every, streams_of
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs
from tests.ros.streams import BEGIN, MS

_SECOND = 1000 * MS


def _suggested(streams, **keys):
    topics = inputs({stream.topic: VECTOR for stream in streams})
    chosen = {"policy": "approximate_time", "slop": "10ms", "topics": topics, **keys}
    text = config({"front": {key: value for key, value in chosen.items() if value is not None}})
    group = group_of(text, "front")
    return suggest(
        group, streams, evaluate(group, streams), lambda changes: group_of(with_changes(text, changes), "front")
    )


def _values(suggestion):
    return {(change.topic, change.key): change.value for change in suggestion.changes}


def test_values_that_do_are_left_alone():
    streams = streams_of(every(100 * MS, 100, phase=2 * MS, jitter=3 * MS), every(100 * MS, 100, jitter=2 * MS, seed=2))
    suggestion = _suggested(streams, policy="approximate_time_eager")
    assert (suggestion.changes, suggestion.now) == ((), suggestion.possible)


def test_a_slop_that_is_too_small_is_widened_to_what_is_needed():
    streams = streams_of(every(100 * MS, 200, jitter=2 * MS), every(40 * MS, 500, jitter=MS, seed=2))
    suggestion = _suggested(streams, policy="approximate_time_eager")
    assert suggestion.now < suggestion.possible
    assert suggestion.then >= 0.99 * suggestion.possible
    assert _values(suggestion).keys() == {(None, "slop")}
    assert 20 <= int(_values(suggestion)[None, "slop"].removesuffix("ms")) <= 25


def test_a_slop_that_is_far_too_wide_is_narrowed():
    streams = streams_of(every(100 * MS, 100, phase=MS, jitter=MS), every(100 * MS, 100, jitter=MS, seed=2))
    assert _values(_suggested(streams, slop="80ms"))[None, "slop"].endswith("ms")


def test_messages_that_lost_their_partner_do_not_widen_slop():
    camera = every(33 * MS, 600, jitter=MS)
    del camera[::60]
    streams = streams_of(every(99 * MS, 200, jitter=MS), camera)
    suggestion = _suggested(streams, slop="6ms")
    assert (None, "slop") not in _values(suggestion)
    assert suggestion.now >= 0.99 * suggestion.possible


def test_stamps_that_are_equal_want_exact_time():
    stamps = every(50 * MS, 100, jitter=5 * MS)
    suggestion = _suggested(streams_of(stamps, stamps[3:]))
    assert _values(suggestion)[None, "policy"] == "exact_time"
    assert suggestion.then == suggestion.possible == 97


def test_stamps_that_never_are_equal_want_approximate_time():
    stamps = every(50 * MS, 100)
    suggestion = _suggested(streams_of(stamps, [stamp + 9 for stamp in stamps]), policy="exact_time", slop=None)
    assert suggestion.now == 0
    assert _values(suggestion)[None, "policy"] == "approximate_time"
    assert suggestion.then >= 99


def test_a_queue_that_is_too_short_is_lengthened():
    # 60 messages of the fast input come before the slow one's, which is 300 ms late.
    streams = streams_of(every(_SECOND, 200, jitter=MS), every(5 * MS, 40_100), late=300 * MS)
    suggestion = _suggested(streams, policy="approximate_time_eager", slop="3ms")
    assert suggestion.then >= 0.99 * suggestion.possible > suggestion.now
    assert 60 <= _values(suggestion)[None, "queue_size"] <= 90


def test_unset_stamps_want_the_receive_time_for_all():
    streams = streams_of(every(100 * MS, 50), every(100 * MS, 50, phase=MS))
    streams[1].stamps = array("q", [0] * 50)
    suggestion = _suggested(streams)
    assert {key: value for key, value in _values(suggestion).items() if key[1] == "stamp"} == {
        (0, "stamp"): "receive",
        (1, "stamp"): "receive",
    }
    assert suggestion.then >= 0.99 * suggestion.possible


@pytest.mark.parametrize(
    "keys",
    [{"policy": "exact_time", "slop": None}, {"policy": "approximate_time", "slop": "0ms"}],
    ids=["exact_time", "slop_0"],
)
@pytest.mark.parametrize("phase", [0, MS])
def test_receive_times_want_a_tolerance_too_which_no_file_may_go_without(keys, phase):
    streams = streams_of(every(100 * MS, 50), every(100 * MS, 50, phase=phase))
    streams[1].stamps = array("q", [0] * 50)
    suggestion = _suggested(streams, **keys)
    values = _values(suggestion)
    assert values[0, "stamp"] == values[1, "stamp"] == "receive"
    assert values.get((None, "policy"), keys["policy"]) == "approximate_time"
    assert values[None, "slop"].endswith("ms")
    assert len(values) == len(suggestion.changes)
    assert suggestion.then >= 0.99 * suggestion.possible


def test_a_clock_of_another_time_wants_an_offset():
    streams = streams_of(every(100 * MS, 50), every(100 * MS, 50))
    streams[1].stamps = array("q", [stamp - 3600 * _SECOND for stamp in streams[1].stamps])
    suggestion = _suggested(streams)
    assert _values(suggestion)[1, "offset"] == "3600s"
    assert suggestion.then >= 0.99 * suggestion.possible


def test_what_comes_seconds_late_is_given_no_offset_that_would_cost_sets():
    chance = random.Random(7)
    at = list(accumulate(chance.randint(80 * MS, 400 * MS) for _ in range(60)))
    streams = streams_of([BEGIN + each for each in at], [BEGIN + each for each in at], late=3 * _SECOND)
    suggestion = _suggested(streams, queue_size=100)
    assert suggestion.then >= suggestion.now == 60
    assert not any(change.key == "offset" for change in suggestion.changes)


def test_least_periods_are_suggested_where_sets_leave_sooner():
    streams = streams_of(every(100 * MS, 100, jitter=MS), every(100 * MS, 100, phase=2 * MS, jitter=MS, seed=2))
    suggestion = _suggested(streams)
    assert {key for key in _values(suggestion) if key[1] == "min_period"} == {(0, "min_period"), (1, "min_period")}
    (reason,) = {change.reason for change in suggestion.changes}
    assert reason.startswith("sets leave 9")
    assert reason.endswith("ms sooner")


def test_a_constant_distance_is_a_hint_and_no_change():
    streams = streams_of(every(100 * MS, 100, jitter=MS), every(100 * MS, 100, phase=12 * MS, jitter=MS, seed=2))
    suggestion = _suggested(streams, slop="15ms")
    assert "if one trigger starts both, write `offset: -12ms` at /b" in suggestion.hints[0]
    assert not any(change.key == "offset" for change in suggestion.changes)


def test_values_that_help_nothing_are_not_suggested():
    # No two stamps are near: nothing reaches what is possible, whatever the values.
    streams = streams_of([BEGIN + n * _SECOND for n in range(20)], [BEGIN + n * _SECOND for n in range(20, 40)])
    suggestion = _suggested(streams)
    assert not any(change.key in ("slop", "queue_size") for change in suggestion.changes) or suggestion.then > 0


def test_what_a_policy_means_is_not_measured():
    streams = streams_of(every(100 * MS, 10), every(100 * MS, 10))
    suggestion = _suggested(streams, policy="latest_time", trigger="/a", slop=None)
    assert (suggestion.changes, len(suggestion.hints)) == ((), 1)
    text = config({"front": {"policy": "latest_time", "trigger": "/a", "topics": inputs({"/a": VECTOR, "/b": VECTOR})}})
    assert possible_sets(group_of(text, "front"), streams) is None
