"""What the analysis measures, on streams of which all is known."""

import random
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.explain import UNREADABLE, Code
from syncrelay.recordings.analysis.analysis import Analysis, analyze_group, group_of
from syncrelay.recordings.analysis.curves import curves_of
from syncrelay.recordings.analysis.evaluation import evaluate, looked_at
from syncrelay.recordings.analysis.pairs import pair
from syncrelay.recordings.analysis.report_text import report
from syncrelay.recordings.analysis.streams import Stream, stamped
from syncrelay.recordings.analysis.topics import figures_of
from syncrelay.recordings.analysis.watching import watch_group
from syncrelay.sync import DropReason
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs
from tests.ros.streams import BEGIN, MS

_SECOND = 1000 * MS


def streams_of(*topics, latency=5 * MS, late=0):
    """Streams of stamps in nanoseconds, received `latency` later, and those of the first topic later by `late`."""
    came = sorted(
        (stamp + latency + (0 if index else late), index, stamp)
        for index, stamps in enumerate(topics)
        for stamp in stamps
    )
    rows = [(index, (stamp, received, place)) for place, (received, index, stamp) in enumerate(came)]
    return [
        Stream.of(f"/{'abcdef'[index]}", VECTOR, [row for at, row in rows if at == index])
        for index in range(len(topics))
    ]


def every(period, count, *, phase=0, jitter=0, seed=1):
    chance = random.Random(seed)
    return [BEGIN + phase + n * period + round(chance.uniform(-jitter, jitter)) for n in range(count)]


def test_the_rhythm_of_a_topic_is_measured():
    stamps = every(100 * MS, 100, jitter=2 * MS)
    del stamps[50:53]
    (stream,) = streams_of(stamps)
    figures = figures_of(stream)
    assert (figures.messages, figures.gaps) == (97, 1)
    assert figures.period == pytest.approx(100 * MS, abs=MS)
    assert figures.longest_gap == pytest.approx(400 * MS, abs=4 * MS)
    assert figures.jitter is not None
    assert MS < figures.jitter < 4 * MS
    assert figures.rate_hz == pytest.approx(9.7, abs=0.1)
    assert figures.delay is not None
    assert (figures.delay.median, figures.delay.greatest) == (5 * MS, 5 * MS)


def test_faults_of_stamps_are_counted():
    values = [100, 200, 200, 150, 0, UNREADABLE, 300]
    figures = figures_of(Stream.of("/a", VECTOR, [*zip(values, range(1000, 1700, 100), range(7), strict=True)]))
    assert (figures.duplicates, figures.out_of_order, figures.unstamped, figures.unreadable) == (1, 1, 1, 1)


def test_a_topic_without_stamps_has_its_rhythm_by_arrival_and_no_delay():
    figures = figures_of(Stream.of("/a", VECTOR, [(0, at, place) for place, at in enumerate(every(20 * MS, 50))]))
    assert (figures.period, figures.rate_hz, figures.delay, figures.unstamped) == (20 * MS, 50.0, None, 50)


@pytest.mark.parametrize("ppm", [-40, 0, 250])
def test_drift_is_measured_in_parts_per_million(ppm):
    stamps = every(50 * MS, 2000)
    chance = random.Random(1)
    received = [stamp + 5 * MS + (stamp - BEGIN) * ppm // 1_000_000 + round(chance.uniform(0, MS)) for stamp in stamps]
    stream = Stream.of("/a", VECTOR, [*zip(stamps, received, range(2000), strict=True)])
    found = figures_of(stream).drift_ppm
    assert found == pytest.approx(ppm, abs=5) if ppm else found is None or abs(found) < 5


def test_a_pair_is_measured_from_the_slower_to_the_faster():
    slow, fast = streams_of(every(100 * MS, 20, phase=3 * MS), every(20 * MS, 100))
    for first, second in ((slow, fast), (fast, slow)):
        found = pair(first, second, (0, 0))
        assert found is not None
        assert (found.first, found.second) == ("/a", "/b")
        assert {found.signed.least, found.signed.greatest} == {-3 * MS}
    shifted = pair(slow, fast, (-3 * MS, 0))
    assert shifted is not None
    assert shifted.signed.median == 0
    assert pair(slow, Stream("/c", VECTOR), (0, 0)) is None


def _pair_of(policy="approximate_time", **keys):
    topics = inputs({"/a": VECTOR, "/b": VECTOR})
    group = {"policy": policy, "slop": "10ms", "topics": topics, **keys}
    return config({"front": {key: value for key, value in group.items() if value is not None}})


def _analyzed(streams, text):
    return analyze_group(group_of(text, "front"), tuple(streams), text)


@given(
    policy=st.sampled_from(("approximate_time", "approximate_time_eager", "approximate_epsilon_time")),
    keys=st.fixed_dictionaries(
        {"slop": st.integers(0, 20), "queue_size": st.integers(1, 12), "every": st.integers(1, 3)}
    ),
    period=st.sampled_from([20, 50, 100]),
    late=st.integers(0, 300),
)
def test_a_curve_at_the_suggested_value_is_what_the_suggestion_promises(policy, keys, period, late):
    streams = streams_of(
        every(100 * MS, 20, jitter=3 * MS), every(period * MS, 2000 // period, jitter=MS, seed=2), late=late * MS
    )
    found = _analyzed(streams, _pair_of(policy, **{**keys, "slop": f"{keys['slop']}ms"}))
    if found.suggested.options.policy == policy:
        by_queue = {point.value: point.sets for point in found.curves.by_queue_size}
        by_slop = {point.value: point.sets for point in found.curves.by_slop}
        assert by_queue[found.suggested.options.queue_size] == found.suggestion.then
        assert by_slop[found.suggested.options.slop] == found.suggestion.then
    assert found.curves.is_of_all


def test_each_point_of_a_curve_is_what_a_file_with_that_value_and_the_rest_of_the_suggestion_gives():
    streams = streams_of(every(100 * MS, 200, jitter=MS), every(10 * MS, 2000, jitter=MS, seed=2), late=30 * MS)
    found = _analyzed(streams, _pair_of(slop="4ms", queue_size=3))
    for points, key in ((found.curves.by_queue_size, "queue_size"), (found.curves.by_slop, "slop")):
        for point in points:
            options = found.suggested.options.model_copy(update={key: point.value})
            made = evaluate(replace(found.suggested, options=options), streams).sets
            sets = [each for each in made if each.span <= found.possible.widest]
            assert len(sets) == point.sets
            assert point.median_span == (sorted(each.span for each in sets)[(len(sets) - 1) // 2] if sets else 0)


def test_of_a_long_recording_values_are_tried_on_its_begin_and_that_is_said():
    streams = tuple(streams_of(every(100 * MS, 100), every(100 * MS, 100)))
    found = _analyzed(streams, _pair_of(queue_size=5))
    curves = curves_of(found.group, found.suggested, streams, most=50)
    assert curves is not None
    assert (curves.messages, curves.recorded, curves.is_of_all, curves.of) == (50, 200, False, 25)
    assert curves.lasts == 24 * 100 * MS
    first = streams_of(every(100 * MS, 25), every(100 * MS, 25))
    assert {point.value: point.sets for point in curves.by_queue_size}[5] == len(evaluate(found.group, first).sets)


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


@given(
    topics=st.lists(st.lists(st.integers(1, 80), min_size=1, max_size=20), min_size=3, max_size=3),
    faults=st.dictionaries(st.tuples(st.integers(0, 2), st.integers(0, 19)), st.sampled_from([0, UNREADABLE])),
    slop=st.integers(0, 15),
    queue_size=st.integers(1, 4),
    optional=st.booleans(),
)
def test_what_was_not_needed_is_as_defined(topics, faults, slop, queue_size, optional):
    streams = streams_of(*([BEGIN + stamp for stamp in stamps] for stamps in topics), latency=5)
    for (index, place), stamp in faults.items():
        if place < len(topics[index]):
            streams[index].stamps[place] = stamp
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
    expected = [bool(len(found.possible)) and _costs_nothing(drop, found) for drop in found.evaluation.drops]
    assert found.unneeded.flags.tolist() == expected
    for row, counts in zip(found.fates, found.evaluation.counts, strict=True):
        assert row.received == row.matched + row.unneeded + sum(row.dropped.values()) == counts.fed


@pytest.mark.parametrize(("max_age", "cures"), [("150ms", True), ("60ms", False)])
def test_a_device_is_offered_to_be_mapped_where_that_brings_the_sets_of_a_clock_in_the_recording(max_age, cures):
    def analyzed(**device):
        topics = inputs({"/a": VECTOR, "/b": VECTOR})
        topics[1].update(device)
        group = {"policy": "latest_time", "trigger": "37 Hz", "max_age": max_age, "topics": topics}
        streams = streams_of(every(20 * MS, 2000), every(100 * MS, 400, jitter=MS))
        streams[1].stamps[:] -= 7200 * _SECOND
        text = config({"front": group})
        return _analyzed(stamped(group_of(text, "front"), streams), text)

    first, mapped = analyzed().findings[0].finding, analyzed(clock="device")
    assert first.code is Code.OTHER_CLOCK
    offered = re.search(r"write `clock: device` at /b, which would give (\d+) of (\d+) ", first.suggestion)
    assert (offered is not None) is cures
    if offered is not None:
        assert len(mapped.evaluation.sets) == int(offered[1]) == int(offered[2])
    assert (mapped.findings == ()) is cures


def test_a_recording_of_a_camera_and_a_lidar_that_are_apart_beside_an_imu_is_given_a_slop():
    """Live none is offered: beside the period of the IMU, sets of other messages are as near."""
    text = _pair_of(topics=inputs({"/a": VECTOR, "/b": VECTOR, "/c": VECTOR}))
    found = _analyzed(streams_of(every(100 * MS, 200), every(100 * MS, 200, phase=30 * MS), every(10 * MS, 2000)), text)
    assert (found.suggestion.now, found.suggestion.then) == (0, found.suggestion.possible)
    assert found.suggestion.changes[0].key == "slop"


@pytest.mark.parametrize("own_clock_s", [0, 3], ids=["one clock", "two clocks"])
@pytest.mark.parametrize("is_required", [True, False], ids=["required", "optional"])
def test_arrival_is_offered_where_stamps_are_unset_and_elsewhere_only_if_that_brings_more(own_clock_s, is_required):
    stamps = [every(100 * MS, 100, jitter=2 * MS, seed=seed) for seed in range(3)]
    came = streams_of(*stamps)
    unset = Stream.of("/c", VECTOR, [(0, stamp + 6 * MS, place) for place, stamp in enumerate(stamps[2])])
    apart = _SECOND * own_clock_s
    other = Stream.of("/b", VECTOR, [(stamp + apart, stamp + 5 * MS, place) for place, stamp in enumerate(stamps[1])])
    topics = [*inputs({"/a": VECTOR, "/b": VECTOR}), {"topic": "/c", "type": VECTOR, "required": is_required}]
    text = config({"front": {"policy": "approximate_time", "slop": "20ms", "max_wait": "50ms", "topics": topics}})
    found = _analyzed([came[0], other, unset], text if not is_required else text.replace("max_wait: 50ms", ""))
    offered = {change.topic for change in found.suggestion.changes if change.key == "stamp"}
    assert offered == ({0, 1, 2} if own_clock_s else {2})


def _watched(streams):
    group = group_of(_pair_of(), "front")
    found = watch_group(group, streams, evaluate(group, streams))
    return {(each.finding.code.value, each.finding.input): each.seconds for each in found}


@pytest.mark.parametrize("pause", [60, 300, 5_000, 86_400, 54 * 365 * 86_400])
def test_a_pause_is_found_for_as_long_as_it_lasts(pause):
    before, after = every(100 * MS, 300), every(100 * MS, 300, phase=(30 + pause) * _SECOND)
    found = _watched(streams_of([*before, *after], [*before, *after]))
    assert found.keys() == {("silent", None)}
    assert all(pause - 6 <= seconds <= pause for seconds in found.values())


def test_one_message_of_1970_does_not_keep_the_others_from_being_judged():
    stamps = every(100 * MS, 300)
    (first, second) = streams_of(stamps, [stamp + 30 * MS for stamp in stamps])
    rows = np.stack(first.arrays(), axis=1).tolist()
    first = Stream.of(first.topic, VECTOR, [(stamps[0] - MS, 5 * _SECOND, -1), *rows])
    assert 20 < _watched([first, second])["over_slop", None] <= 30


@given(st.one_of(st.integers(-(2**63), 200), st.integers(0, 2**63)))
def test_few_seconds_of_a_pause_are_looked_at_and_they_stand_for_all(seconds):
    looks = looked_at(seconds)
    assert looks == sorted(set(looks))
    assert len(looks) <= 32 + 63
    assert looks[:16] == list(range(1, min(16, max(0, seconds)) + 1))
    assert looks[-16:] == list(range(max(1, seconds - 15), seconds + 1))


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({}, "50 sets, 48 of 50 possible sets: the others are not of the nearest messages"),
        ({"age_penalty": 0}, "50 of 50 possible sets"),
        ({"every": 2}, "25 sets after thinning, 48 of 50 possible sets"),
    ],
)
def test_it_is_said_why_more_or_fewer_sets_left_than_there_were_possible(keys, said):
    streams = streams_of(every(100 * MS, 50), every(60 * MS, 83, jitter=20 * MS))
    group = {"policy": "approximate_time", "slop": "40ms", **keys, "topics": inputs({"/a": VECTOR, "/b": VECTOR})}
    text = config({"front": group})
    lines = report("rig.mcap", Analysis(BEGIN, BEGIN, (), (_analyzed(streams, text),), text, ()))
    assert next(line for line in lines if "possible" in line) == f"  {said}"
