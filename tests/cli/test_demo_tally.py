import pytest

from syncrelay.cli.tally import GroupPlan, Spans, Tally
from syncrelay.ros.snapshot import RelaySnapshot
from tests.cli.demo_states import MS, PLAN, a_drop, a_group, a_set, an_input


def state(*, sets, camera, lidar, recent=()):
    inputs = [an_input("/camera", fed=camera), an_input("/lidar", fed=lidar)]
    return RelaySnapshot((a_group(recent, sets=sets, inputs=inputs),))


def test_rates_are_those_of_the_last_four_seconds():
    tally = Tally([PLAN])
    for second, sets in enumerate([1, 1, 1, 10, 19, 28, 37]):
        tally.add(float(second), state(sets=sets, camera=1 + 30 * second, lidar=1 + 10 * second))
    (figures,) = tally.figures()
    assert (figures.sets_hz, figures.best_hz) == (9.0, 10.0)
    assert figures.input_hz == (30.0, 10.0)


def test_rates_are_zero_as_long_as_there_is_one_snapshot():
    tally = Tally([PLAN])
    tally.add(0.0, state(sets=3, camera=3, lidar=3))
    (figures,) = tally.figures()
    assert (figures.sets_hz, figures.best_hz, figures.input_hz) == (0.0, 0.0, (0.0, 0.0))


def test_a_long_silence_between_snapshots_still_gives_a_rate():
    tally = Tally([PLAN])
    tally.add(0.0, state(sets=1, camera=1, lidar=1))
    tally.add(20.0, state(sets=101, camera=401, lidar=201))
    (figures,) = tally.figures()
    assert (figures.sets_hz, figures.best_hz) == (5.0, 10.0)


def test_as_many_sets_are_possible_as_the_slowest_input_gave_messages():
    tally = Tally([PLAN])
    tally.add(0.0, state(sets=8, camera=30, lidar=10))
    assert tally.figures()[0].possible == 10


def test_rates_are_measured_from_when_every_input_has_given_a_message():
    tally = Tally([PLAN])
    tally.add(0.0, state(sets=0, camera=0, lidar=0))
    tally.add(1.0, state(sets=0, camera=0, lidar=10))
    (waiting,) = tally.figures()
    tally.add(2.0, state(sets=9, camera=30, lidar=20))
    (running,) = tally.figures()
    assert (waiting.sets_hz, waiting.best_hz, waiting.input_hz) == (0.0, 0.0, (0.0, 10.0))
    assert (running.sets_hz, running.best_hz) == (9.0, 10.0)


def test_sets_are_possible_from_when_every_input_has_given_a_message():
    tally = Tally([PLAN])
    tally.add(0.0, state(sets=0, camera=0, lidar=20))
    tally.add(1.0, state(sets=8, camera=31, lidar=30))
    tally.add(2.0, state(sets=18, camera=61, lidar=40))
    assert tally.figures()[0].possible == 20


def test_every_set_counts_once_however_often_it_is_shown():
    tally = Tally([GroupPlan("approximate_time", 10 * MS, (0, 0))])
    tally.add(0.0, state(sets=2, camera=2, lidar=2, recent=[a_set(0, 1), a_set(10, 12)]))
    tally.add(1.0, state(sets=2, camera=2, lidar=2, recent=[a_set(0, 1), a_set(10, 12)]))
    tally.add(2.0, state(sets=3, camera=3, lidar=3, recent=[a_set(10, 12), a_set(20, 29)]))
    (figures,) = tally.figures()
    assert figures.spans is not None
    assert figures.spans.median == 2 * MS
    assert figures.spans.p95 == pytest.approx(8.3 * MS)


def test_a_single_set_has_a_span():
    tally = Tally([GroupPlan("approximate_time", 10 * MS, (0, 0))])
    tally.add(0.0, state(sets=1, camera=1, lidar=1, recent=[a_set(0, 3)]))
    assert tally.figures()[0].spans == Spans(median=3 * MS, p95=3 * MS, unshifted=3 * MS)


def test_the_span_without_offsets_is_that_of_the_stamps_as_they_came():
    tally = Tally([PLAN])  # -12 ms on the camera
    tally.add(0.0, state(sets=1, camera=1, lidar=1, recent=[a_set(112, 101)]))
    spans = tally.figures()[0].spans
    assert spans is not None
    assert (spans.median, spans.unshifted) == (1 * MS, 11 * MS)


def test_what_is_drawn_has_the_stamps_it_was_matched_by():
    tally = Tally([PLAN])
    recent = [a_set(112, 101), a_set(None, 201), a_drop(0, 145), a_drop(1, 301)]
    tally.add(0.0, state(sets=2, camera=2, lidar=3, recent=recent))
    assert tally.figures()[0].state.recent == (a_set(100, 101), a_set(None, 201), a_drop(0, 133), a_drop(1, 301))


def test_a_set_without_an_optional_message_spans_the_others():
    tally = Tally([GroupPlan("approximate_time", 10 * MS, (0, -5 * MS, 0))])
    inputs = [an_input("/a"), an_input("/b"), an_input("/c")]
    tally.add(0.0, RelaySnapshot((a_group([a_set(0, None, 2)], inputs=inputs),)))
    assert tally.figures()[0].spans == Spans(median=2 * MS, p95=2 * MS, unshifted=2 * MS)


def test_without_a_set_there_is_no_span():
    tally = Tally([PLAN])
    tally.add(0.0, state(sets=0, camera=1, lidar=1))
    assert tally.figures()[0].spans is None
