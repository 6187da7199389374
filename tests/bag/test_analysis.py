"""What the analysis measures and suggests, on streams of which all is known."""

import random
from array import array
from itertools import accumulate, product

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from syncrelay.bag.analysis.analysis import analyze_group, group_of
from syncrelay.bag.analysis.changes import Change, file_with_changes, patch, with_changes
from syncrelay.bag.analysis.curves import curves_of
from syncrelay.bag.analysis.evaluation import completed, evaluate
from syncrelay.bag.analysis.nearest import pair, tightest
from syncrelay.bag.analysis.streams import Stream
from syncrelay.bag.analysis.suggest import possible_sets, suggest
from syncrelay.bag.analysis.topics import figures_of
from syncrelay.bag.analysis.watching import judged_seconds, watch_group
from syncrelay.errors import BagError
from syncrelay.explain import UNREADABLE
from syncrelay.sync import DropReason
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs
from tests.ros.streams import BEGIN, MS

_SECOND = 1000 * MS


def _streams(*topics, latency=5 * MS, late=0):
    """Streams of stamps in nanoseconds, received `latency` later, and those of the first topic later by `late`."""
    came = sorted(
        (stamp + latency + (0 if index else late), index, stamp)
        for index, stamps in enumerate(topics)
        for stamp in stamps
    )
    streams = [Stream(f"/{'abcdef'[index]}", VECTOR) for index in range(len(topics))]
    for place, (received, index, stamp) in enumerate(came):
        for values, value in (("stamps", stamp), ("received", received), ("places", place)):
            getattr(streams[index], values).append(value)
    return streams


def _every(period, count, *, phase=0, jitter=0, seed=1):
    chance = random.Random(seed)
    return [BEGIN + phase + n * period + round(chance.uniform(-jitter, jitter)) for n in range(count)]


def test_the_rhythm_of_a_topic_is_measured():
    stamps = _every(100 * MS, 100, jitter=2 * MS)
    del stamps[50:53]
    (stream,) = _streams(stamps)
    figures = figures_of(stream)
    assert (figures.messages, figures.gaps) == (97, 1)
    assert figures.period == pytest.approx(100 * MS, abs=MS)
    assert figures.longest_gap == pytest.approx(400 * MS, abs=4 * MS)
    assert MS < figures.jitter < 4 * MS
    assert figures.rate_hz == pytest.approx(9.7, abs=0.1)
    assert (figures.delay.median, figures.delay.greatest) == (5 * MS, 5 * MS)


def test_faults_of_stamps_are_counted():
    values = array("q", [100, 200, 200, 150, 0, UNREADABLE, 300])
    places = array("q", range(7))
    figures = figures_of(Stream("/a", VECTOR, values, array("q", range(1000, 1700, 100)), places))
    assert (figures.duplicates, figures.out_of_order, figures.unstamped, figures.unreadable) == (1, 1, 1, 1)


def test_a_topic_without_stamps_has_its_rhythm_by_arrival_and_no_delay():
    zeros = array("q", [0] * 50)
    figures = figures_of(Stream("/a", VECTOR, zeros, array("q", _every(20 * MS, 50)), array("q", range(50))))
    assert (figures.period, figures.rate_hz, figures.delay, figures.unstamped) == (20 * MS, 50.0, None, 50)


@pytest.mark.parametrize("ppm", [-40, 0, 250])
def test_drift_is_measured_in_parts_per_million(ppm):
    stamps = _every(50 * MS, 2000)
    chance = random.Random(1)
    received = [stamp + 5 * MS + (stamp - BEGIN) * ppm // 1_000_000 + round(chance.uniform(0, MS)) for stamp in stamps]
    stream = Stream("/a", VECTOR, array("q", stamps), array("q", received), array("q", range(2000)))
    found = figures_of(stream).drift_ppm
    assert found == pytest.approx(ppm, abs=5) if ppm else found is None or abs(found) < 5


def test_a_pair_is_measured_from_the_slower_to_the_faster():
    slow, fast = _streams(_every(100 * MS, 20, phase=3 * MS), _every(20 * MS, 100))
    for first, second in ((slow, fast), (fast, slow)):
        found = pair(first, second, (0, 0))
        assert (found.first, found.second) == ("/a", "/b")
        assert {found.signed.least, found.signed.greatest} == {-3 * MS}
    assert pair(slow, fast, (-3 * MS, 0)).signed.median == 0
    assert pair(slow, Stream("/c", VECTOR), (0, 0)) is None


_STAMPS = st.lists(st.integers(1, 60), min_size=1, max_size=8, unique=True).map(sorted)


@given(st.lists(_STAMPS, min_size=2, max_size=4))
def test_the_tightest_sets_are_those_of_all_combinations(topics):
    streams = _streams(*topics, latency=0)
    found = tightest(streams, [0] * len(topics))
    others = [stamps for index, stamps in enumerate(topics) if index != found.pivot]
    expected = [
        min(max(stamp, *a_set) - min(stamp, *a_set) for a_set in product(*others)) for stamp in topics[found.pivot]
    ]
    assert found.spans.tolist() == expected


def test_a_queue_must_hold_what_comes_until_the_set_can_leave():
    # The slow input's message comes 5 messages of the fast one after its partner.
    slow, fast = _streams([BEGIN + 100 * MS], _every(10 * MS, 40))
    slow.places = array("q", [16])
    fast.places = array("q", [place for place in range(41) if place != 16])
    assert tightest([slow, fast], (0, 0)).queues.tolist() == [6]


def _pair_of(policy="approximate_time", **keys):
    topics = inputs({"/a": VECTOR, "/b": VECTOR})
    group = {"policy": policy, "slop": "10ms", "topics": topics, **keys}
    return config({"front": {key: value for key, value in group.items() if value is not None}})


def _analyzed(streams, text):
    return analyze_group(group_of(text, "front"), tuple(streams), text)


_POLICIES = ("approximate_time", "approximate_time_eager", "approximate_epsilon_time", "exact_time")


@pytest.mark.parametrize("policy", _POLICIES)
@settings(max_examples=15)
@given(
    keys=st.fixed_dictionaries(
        {"slop": st.integers(0, 20), "queue_size": st.integers(1, 12), "every": st.integers(1, 3)}
    ),
    period=st.sampled_from([20, 50, 100]),
    late=st.integers(0, 300),
)
def test_a_curve_at_the_value_in_use_is_the_count_beside_it(policy, keys, period, late):
    streams = _streams(
        _every(100 * MS, 20, jitter=3 * MS), _every(period * MS, 2000 // period, jitter=MS, seed=2), late=late * MS
    )
    slop = None if policy == "exact_time" else f"{keys['slop']}ms"
    found = _analyzed(streams, _pair_of(policy, **{**keys, "slop": slop}))
    count = completed(found.evaluation.counts, 0)
    in_use = {point.value: point.sets for point in found.curves.by_queue_size}
    assert in_use[keys["queue_size"]] == count
    if slop is None:
        assert found.curves.by_slop == ()
    else:
        in_use = {point.value: point.sets for point in found.curves.by_slop}
        assert in_use[found.group.options.slop] == count
    assert found.curves.is_of_all


def test_each_point_of_a_curve_is_what_a_file_with_that_value_gives():
    streams = _streams(_every(100 * MS, 200, jitter=MS), _every(10 * MS, 2000, jitter=MS, seed=2), late=30 * MS)
    curves = _analyzed(streams, _pair_of(slop="7ms", queue_size=3)).curves
    for point in curves.by_queue_size:
        text = _pair_of(slop="7ms", queue_size=point.value)
        assert len(evaluate(group_of(text, "front"), streams).sets) == point.sets
    assert [point.value for point in curves.by_queue_size] == sorted({point.value for point in curves.by_queue_size})
    for point in curves.by_slop:
        sets = evaluate(group_of(_pair_of(slop=f"{point.value}ns", queue_size=3), "front"), streams).sets
        assert len(sets) == point.sets
        assert point.median_span == (sorted(each.span for each in sets)[(len(sets) - 1) // 2] if sets else 0)


def test_of_a_long_recording_values_are_tried_on_its_begin_and_that_is_said():
    streams = tuple(_streams(_every(100 * MS, 100), _every(100 * MS, 100)))
    found = _analyzed(streams, _pair_of(queue_size=5))
    curves = curves_of(found.group, found.suggested, streams, found.possible, most=50)
    assert (curves.messages, curves.recorded, curves.is_of_all, curves.of) == (50, 200, False, 25)
    assert curves.lasts == 24 * 100 * MS
    first = _streams(_every(100 * MS, 25), _every(100 * MS, 25))
    count = len(evaluate(found.group, first).sets)
    assert {point.value: point.sets for point in curves.by_queue_size}[5] == count


def test_a_gps_beside_fast_odometry_has_no_needless_loss_to_show():
    # 20 Hz beside 1 Hz: 19 of 20 have no partner to miss.
    streams = _streams(_every(_SECOND, 60, phase=24 * MS), _every(50 * MS, 1200, jitter=2 * MS), late=40 * MS)
    found = _analyzed(streams, _pair_of(slop="30ms"))
    gps, odometry = found.fates
    assert len(found.evaluation.sets) == found.suggestion.possible == 60
    assert found.evaluation.counts[1].dropped[DropReason.OVERFLOW] > 500
    assert (odometry.matched, odometry.unneeded, odometry.dropped, odometry.lacking) == (60, 1140, {}, ("/a",))
    assert (gps.matched, gps.unneeded, gps.dropped) == (60, 0, {})
    assert {point.value: point.sets for point in found.curves.by_queue_size}[10] == 60
    assert not [each for each in found.findings if each.finding.severity.name != "OK"]


def test_drops_that_cost_a_set_are_told_from_those_that_do_not():
    # The slow input's messages come 300 ms late: its partners have overflowed by then.
    streams = _streams(_every(_SECOND, 30, jitter=MS), _every(5 * MS, 6_100), late=300 * MS)
    found = _analyzed(streams, _pair_of("approximate_time_eager", slop="3ms"))
    slow, fast = found.fates
    assert found.suggestion.now < 2
    assert slow.received - slow.matched - slow.unneeded == sum(slow.dropped.values()) > 27
    assert 27 < sum(fast.dropped.values()) < 100 < fast.unneeded
    assert fast.lacking == ("/a",)


def test_what_slop_alone_keeps_apart_was_needed():
    streams = _streams(_every(100 * MS, 50), _every(100 * MS, 50, phase=3 * MS))
    for row in _analyzed(streams, _pair_of(slop="1ms")).fates:
        assert (row.matched, row.unneeded, sum(row.dropped.values())) == (0, 0, 50)


def test_faults_of_stamps_are_never_called_not_needed():
    streams = _streams(_every(_SECOND, 20), _every(50 * MS, 400))
    streams[1].stamps[5], streams[1].stamps[7], streams[1].stamps[9] = 0, UNREADABLE, streams[1].stamps[8]
    _, fast = _analyzed(streams, _pair_of(slop="10ms")).fates
    assert fast.dropped == {DropReason.UNSTAMPED: 1, DropReason.MALFORMED: 1, DropReason.DUPLICATE: 1}
    assert fast.received == 400 == fast.matched + fast.unneeded + 3


_FAULTS = {DropReason.MALFORMED, DropReason.UNSTAMPED, DropReason.DUPLICATE, DropReason.THINNED}


def _costs_nothing(drop, found):
    """Whether a drop cost no set, by its definition, one message after another."""
    group, sets, drops = found.group, found.evaluation.sets, found.evaluation.drops
    offsets = [topic.offset_ns for topic in group.topics]
    if drop.reason in {*_FAULTS, DropReason.LATE, DropReason.TIME_JUMP}:
        return False
    for index, topic in enumerate(group.topics):
        if not topic.required or index == drop.input:
            continue
        left = [each.stamp for each in drops if each.input == index and each.reason not in _FAULTS]
        left += [each.stamps[index] for each in sets if each.stamps[drop.input] is None and each.stamps[index]]
        at = drop.stamp + offsets[drop.input]
        if all(abs(stamp + offsets[index] - at) > found.possible.widest for stamp in left):
            return True
    return False


@settings(max_examples=60)
@given(
    topics=st.lists(st.lists(st.integers(1, 80), min_size=1, max_size=20, unique=True), min_size=3, max_size=3),
    slop=st.integers(0, 15),
    queue_size=st.integers(1, 4),
    optional=st.booleans(),
)
def test_what_was_not_needed_is_as_defined(topics, slop, queue_size, optional):
    streams = _streams(*([BEGIN + stamp for stamp in stamps] for stamps in topics), latency=5)
    rows = inputs({"/a": VECTOR, "/b": VECTOR, "/c": VECTOR})
    rows[1]["offset"] = "3ns"
    if optional:
        rows[2]["required"] = False
    text = _pair_of(
        "approximate_time_eager",
        slop=f"{slop}ns",
        queue_size=queue_size,
        topics=rows,
        max_wait="9ns" if optional else None,
    )
    found = _analyzed(streams, text)
    assert found.possible is not None
    expected = [bool(found.possible.spans) and _costs_nothing(drop, found) for drop in found.evaluation.drops]
    assert found.unneeded.flags.tolist() == expected
    for row, counts in zip(found.fates, found.evaluation.counts, strict=True):
        assert row.received == row.matched + row.unneeded + sum(row.dropped.values()) == counts.fed


def _suggested(streams, **keys):
    topics = inputs({stream.topic: VECTOR for stream in streams})
    group = {"policy": "approximate_time", "slop": "10ms", "topics": topics, **keys}
    text = config({"front": {key: value for key, value in group.items() if value is not None}})
    group = group_of(text, "front")
    return suggest(
        group, streams, evaluate(group, streams), lambda changes: group_of(with_changes(text, changes), "front")
    )


def _values(suggestion):
    return {(change.topic, change.key): change.value for change in suggestion.changes}


def test_values_that_do_are_left_alone():
    streams = _streams(_every(100 * MS, 100, phase=2 * MS, jitter=3 * MS), _every(100 * MS, 100, jitter=2 * MS, seed=2))
    suggestion = _suggested(streams, policy="approximate_time_eager")
    assert (suggestion.changes, suggestion.now) == ((), suggestion.possible)


def test_a_slop_that_is_too_small_is_widened_to_what_is_needed():
    streams = _streams(_every(100 * MS, 200, jitter=2 * MS), _every(40 * MS, 500, jitter=MS, seed=2))
    suggestion = _suggested(streams, policy="approximate_time_eager")
    assert suggestion.now < suggestion.possible
    assert suggestion.then >= 0.99 * suggestion.possible
    assert _values(suggestion).keys() == {(None, "slop")}
    assert 20 <= int(_values(suggestion)[None, "slop"].removesuffix("ms")) <= 25


def test_a_slop_that_is_far_too_wide_is_narrowed():
    streams = _streams(_every(100 * MS, 100, phase=MS, jitter=MS), _every(100 * MS, 100, jitter=MS, seed=2))
    assert _values(_suggested(streams, slop="80ms"))[None, "slop"].endswith("ms")


def test_messages_that_lost_their_partner_do_not_widen_slop():
    camera = _every(33 * MS, 600, jitter=MS)
    del camera[::60]
    streams = _streams(_every(99 * MS, 200, jitter=MS), camera)
    suggestion = _suggested(streams, slop="6ms")
    assert (None, "slop") not in _values(suggestion)
    assert suggestion.now >= 0.99 * suggestion.possible


def test_stamps_that_are_equal_want_exact_time():
    stamps = _every(50 * MS, 100, jitter=5 * MS)
    suggestion = _suggested(_streams(stamps, stamps[3:]))
    assert _values(suggestion)[None, "policy"] == "exact_time"
    assert suggestion.then == suggestion.possible == 97


def test_stamps_that_never_are_equal_want_approximate_time():
    stamps = _every(50 * MS, 100)
    suggestion = _suggested(_streams(stamps, [stamp + 9 for stamp in stamps]), policy="exact_time", slop=None)
    assert suggestion.now == 0
    assert _values(suggestion)[None, "policy"] == "approximate_time"
    assert suggestion.then >= 99


def test_a_queue_that_is_too_short_is_lengthened():
    # 60 messages of the fast input come before the slow one's, which is 300 ms late.
    streams = _streams(_every(_SECOND, 200, jitter=MS), _every(5 * MS, 40_100), late=300 * MS)
    suggestion = _suggested(streams, policy="approximate_time_eager", slop="3ms")
    assert suggestion.then >= 0.99 * suggestion.possible > suggestion.now
    assert 60 <= _values(suggestion)[None, "queue_size"] <= 90


def test_unset_stamps_want_the_receive_time_for_all():
    streams = _streams(_every(100 * MS, 50), _every(100 * MS, 50, phase=MS))
    streams[1].stamps = array("q", [0] * 50)
    suggestion = _suggested(streams)
    assert {key: value for key, value in _values(suggestion).items() if key[1] == "stamp"} == {
        (0, "stamp"): "receive",
        (1, "stamp"): "receive",
    }
    assert suggestion.then >= 0.99 * suggestion.possible


def test_a_clock_of_another_time_wants_an_offset():
    streams = _streams(_every(100 * MS, 50), _every(100 * MS, 50))
    streams[1].stamps = array("q", [stamp - 3600 * _SECOND for stamp in streams[1].stamps])
    suggestion = _suggested(streams)
    assert _values(suggestion)[1, "offset"] == "3600s"
    assert suggestion.then >= 0.99 * suggestion.possible


def test_what_comes_seconds_late_is_given_no_offset_that_would_cost_sets():
    chance = random.Random(7)
    at = list(accumulate(chance.randint(80 * MS, 400 * MS) for _ in range(60)))
    streams = _streams([BEGIN + each for each in at], [BEGIN + each for each in at], late=3 * _SECOND)
    suggestion = _suggested(streams, queue_size=100)
    assert suggestion.then >= suggestion.now == 60
    assert not any(change.key == "offset" for change in suggestion.changes)


def test_least_periods_are_suggested_where_sets_leave_sooner():
    streams = _streams(_every(100 * MS, 100, jitter=MS), _every(100 * MS, 100, phase=2 * MS, jitter=MS, seed=2))
    suggestion = _suggested(streams)
    assert {key for key in _values(suggestion) if key[1] == "min_period"} == {(0, "min_period"), (1, "min_period")}
    (reason,) = {change.reason for change in suggestion.changes}
    assert reason.startswith("sets leave 9")
    assert reason.endswith("ms sooner")


def test_a_constant_distance_is_a_hint_and_no_change():
    streams = _streams(_every(100 * MS, 100, jitter=MS), _every(100 * MS, 100, phase=12 * MS, jitter=MS, seed=2))
    suggestion = _suggested(streams, slop="15ms")
    assert "if one trigger starts both, write `offset: -12ms` at /b" in suggestion.hints[0]
    assert not any(change.key == "offset" for change in suggestion.changes)


def test_values_that_help_nothing_are_not_suggested():
    # No two stamps are near: nothing reaches what is possible, whatever the values.
    streams = _streams([BEGIN + n * _SECOND for n in range(20)], [BEGIN + n * _SECOND for n in range(20, 40)])
    suggestion = _suggested(streams)
    assert not any(change.key in ("slop", "queue_size") for change in suggestion.changes) or suggestion.then > 0


def test_what_a_policy_means_is_not_measured():
    streams = _streams(_every(100 * MS, 10), _every(100 * MS, 10))
    suggestion = _suggested(streams, policy="latest_time", trigger="/a", slop=None)
    assert (suggestion.changes, len(suggestion.hints)) == ((), 1)
    text = config({"front": {"policy": "latest_time", "trigger": "/a", "topics": inputs({"/a": VECTOR, "/b": VECTOR})}})
    assert possible_sets(group_of(text, "front"), streams) is None


def test_the_findings_are_those_of_the_running_relay():
    streams = _streams(_every(100 * MS, 300), _every(100 * MS, 300, phase=30 * MS))
    topics = inputs({"/a": VECTOR, "/b": VECTOR})
    text = config({"front": {"policy": "approximate_time", "slop": "10ms", "topics": topics}})
    first = watch_group(group_of(text, "front"), streams)[0]
    assert (first.finding.code.value, first.finding.severity.name) == ("over_slop", "ERROR")
    assert 20 < first.seconds <= 30


def _watched(streams):
    topics = inputs({"/a": VECTOR, "/b": VECTOR})
    text = config({"front": {"policy": "approximate_time", "slop": "10ms", "topics": topics}})
    return {
        (each.finding.code.value, each.finding.input): each.seconds
        for each in watch_group(group_of(text, "front"), streams)
    }


@pytest.mark.parametrize("pause", [60, 300, 5_000, 86_400, 54 * 365 * 86_400])
def test_a_pause_is_found_for_as_long_as_it_lasts(pause):
    before, after = _every(100 * MS, 300), _every(100 * MS, 300, phase=(30 + pause) * _SECOND)
    found = _watched(_streams([*before, *after], [*before, *after]))
    assert found.keys() == {("silent", None)}
    assert all(pause - 6 <= seconds <= pause for seconds in found.values())


def test_one_message_of_1970_does_not_keep_the_others_from_being_judged():
    stamps = _every(100 * MS, 300)
    (first, second) = _streams(stamps, [stamp + 30 * MS for stamp in stamps])
    for values, value in ((first.stamps, stamps[0] - MS), (first.received, 5 * _SECOND), (first.places, -1)):
        values.insert(0, value)
    assert 20 < _watched([first, second])["over_slop", None] <= 30


@given(st.one_of(st.integers(-(2**63), 200), st.integers(0, 2**63)))
def test_few_seconds_of_a_pause_are_judged_seconds_and_they_stand_for_all(seconds):
    looks = judged_seconds(seconds)
    assert looks == sorted(set(looks))
    assert len(looks) <= 32 + 63
    assert looks[:16] == list(range(1, min(16, max(0, seconds)) + 1))
    assert looks[-16:] == list(range(max(1, seconds - 15), seconds + 1))


def test_an_evaluation_loses_no_message():
    streams = _streams(_every(100 * MS, 50, jitter=9 * MS), _every(30 * MS, 150, jitter=MS))
    evaluation = evaluate(group_of(_pair_of(), "front"), streams)
    assert sum(each.fed for each in evaluation.counts) == 2 * len(evaluation.sets) + len(evaluation.drops) == 200
    assert {drop.reason for drop in evaluation.drops} <= set(DropReason)


_FILE = """\
version: 1
groups:
  front:  # what the robot sees
    policy: approximate_time
    slop: 10ms            # measured in May
    age_penalty: 0.2
    topics:
      - topic: /a         # the camera
        type: x/msg/Y
        min_period: "9ms"
      - {topic: /b, type: x/msg/Y}
"""


def test_changes_keep_comments_quotes_and_order():
    changes = [
        Change("front", None, "slop", "25ms", "wider"),
        Change("front", None, "queue_size", 40, "longer"),
        Change("front", 1, "min_period", "8ms", "sooner"),
    ]
    assert with_changes(_FILE, changes) == _FILE.replace("slop: 10ms ", "slop: 25ms ").replace(
        "    topics:\n", "    queue_size: 40  # longer\n    topics:\n"
    ).replace("type: x/msg/Y}", "type: x/msg/Y, min_period: 8ms}")


def test_changes_keep_the_line_breaks_of_a_file():
    changed = with_changes(_FILE.replace("\n", "\r\n"), [Change("front", None, "slop", "25ms", "")])
    assert changed == _FILE.replace("slop: 10ms", "slop: 25ms").replace("\n", "\r\n")


def test_a_new_policy_takes_with_it_what_it_does_not_have():
    changed = with_changes(_FILE, [Change("front", None, "policy", "exact_time", "")])
    for gone in ("slop", "age_penalty", "min_period"):
        assert gone not in changed
    assert "policy: exact_time" in changed
    assert "# the camera" in changed


def test_a_patch_holds_the_changes_alone():
    changes = [Change("front", None, "slop", "25ms", ""), Change("front", 1, "stamp", "receive", "")]
    assert patch(changes, {"front": ["/a", "/b"]}) == (
        "groups:\n  front:\n    slop: 25ms\n    topics:\n      - topic: /b\n        stamp: receive\n"
    )


_SHARED = """\
version: 1
x-base: &base
  policy: approximate_time
  slop: 20ms # of all
groups:
  front:
    <<: *base
    topics:
      - {topic: /a, type: sensor_msgs/msg/Image}
      - {topic: /b, type: sensor_msgs/msg/Image}
  rear: &rear
    <<: *base
    topics: &topics
      - {topic: /a, type: sensor_msgs/msg/Image}
      - {topic: /b, type: sensor_msgs/msg/Image}
  third:
    <<: *base
    topics: *topics
  fourth:
    <<: *rear
"""


@pytest.mark.parametrize("group", ["front", "third", "fourth"])
def test_a_merged_value_is_changed_in_the_group_alone(group: str):
    changed = file_with_changes(_SHARED, [Change(group, None, "slop", "25ms", "better")])
    assert [line for line in changed.splitlines() if line not in _SHARED.splitlines()] == ["    slop: 25ms  # better"]
    begin = changed.index(f"  {group}:")
    assert begin < changed.index("slop: 25ms") == changed.index("slop: 25ms", begin)


@pytest.mark.parametrize(
    "change",
    [
        Change("rear", None, "slop", "25ms", ""),
        Change("third", 1, "offset", "5ms", ""),
        Change("rear", 1, "offset", "5ms", ""),
        Change("front", None, "policy", "exact_time", ""),
        Change("rear", None, "policy", "exact_time", ""),
    ],
)
def test_what_would_change_another_group_or_cannot_be_taken_away_is_refused(change: Change):
    with pytest.raises(BagError, match="cannot be written for one group alone: write them by hand"):
        file_with_changes(_SHARED, [change])


def test_two_spaces_stand_before_a_comment_on_a_value_that_was_there():
    text = "groups:\n  front:\n    queue_size: 10\n    slop: 20ms  # mine\n"
    changed = with_changes(text, [Change("front", None, "queue_size", 30, "why")])
    assert changed == text.replace("10", "30  # why")
