"""What is said first of faults that look like others: pauses like losses, an offset like a drift."""

from collections.abc import Iterator

from syncrelay.explain import Code, Finding
from tests.explain.scenario import Source, Told, run


def said(told: Told, code: Code) -> Iterator[tuple[float, Finding]]:
    return ((second, each) for second, found in told.found for each in found if each.code is code)


def test_pauses_of_an_input_of_which_few_messages_came_are_told_and_no_queue_is_blamed():
    pausing = Source("/camera", 5, sends=lambda second: second % 5 < 3)
    told = run(pausing, Source("/lidar", 15), seconds=16, options={"slop": "20ms", "queue_size": 14})
    (_, first), *_ = said(told, Code.FEW_SETS)
    assert "messages of /camera did not come: it paused for up to 2" in first.text
    assert not [*said(told, Code.SHORT_QUEUE)]


def test_stamps_that_stay_as_far_apart_do_not_wait_for_a_drift_and_the_two_that_are_far_apart_are_named():
    late = Source("/camera", 5, clock=lambda _: 0.07)
    told = run(late, Source("/lidar", 5), Source("/imu", 100), seconds=8, options={"slop": "10ms", "queue_size": 60})
    (second, first), *_ = said(told, Code.OVER_SLOP)
    assert second < 4
    assert "/camera and /lidar are far from each other" in first.text
    assert "drifts" not in (first.suggestion or "")


def test_a_standstill_explains_no_gap_that_is_usual_for_inputs_of_which_few_messages_came():
    rare = Source("/camera", 0.25), Source("/lidar", 0.25)
    told = run(*rare, seconds=14, options={"slop": "20ms"}, stops=[(1.0, 2.3)])
    assert not [second for second, _ in said(told, Code.TOO_SLOW) if second > 7]
