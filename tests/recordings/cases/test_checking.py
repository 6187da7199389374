"""What comes of drawn, simulated and recorded messages is what the engine and the judge make of them."""

from typing import Any

import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from syncrelay.config import load
from syncrelay.sync import Match, Message
from tests.recordings.bag.making import rig, write_mcap
from tests.recordings.cases.suites import found, left, run
from tests.ros.cdr_messages import VECTOR

PAIR = "camera |a...\nlidar  |.A..\n"
RATES = {"inputs": {"camera": {"rate": "10 Hz"}, "lidar": {"rate": "10 Hz", "phase": "5ms"}}, "lasts": "20s"}
RECORDED = {"topics": [{"topic": "/camera", "type": VECTOR}, {"topic": "/lidar", "type": VECTOR}]}


def test_a_deadline_is_told_by_its_column_and_what_waits_at_the_end_is_not(tmp_path):
    topics = [{"topic": "/camera"}, {"topic": "/lidar"}, {"topic": "/radar", "required": False}]
    drawing = "camera |a.....b\nlidar  |.A....B\nradar  |.......\n"
    assert left(tmp_path, drawing, topics=topics, max_wait="25ms") == ("@3.5: aA-",)


def test_a_set_is_told_with_the_stamp_that_it_is_given(tmp_path):
    assert left(tmp_path, PAIR, restamp="latest") == ("A: aA stamped A",)


def test_a_set_of_a_tick_is_told_with_the_stamp_of_the_tick(tmp_path):
    by_clock: dict[str, Any] = {"policy": "latest_time", "slop": None, "trigger": "20 Hz", "restamp": "trigger"}
    assert left(tmp_path, "camera |.a.......\nlidar  |..A......\n", **by_clock) == ("@5: aA stamped tick",)


def test_letters_of_one_key_belong_together(tmp_path):
    drawing = "camera |ab..\nlidar  |..BA\nkeys: aA bB\n"
    group = {"policy": "equal_key", "slop": None, "key": "header.frame_id"}
    fields = {"camera": {"field": "header.frame_id"}, "lidar": {"field": "header.frame_id"}}
    assert left(tmp_path, drawing, case={"inputs": fields}, **group) == ("B: a superseded, bB",)
    fields["lidar"]["field"] = "header.stamp"
    assert left(tmp_path, drawing, case={"inputs": fields}, **group) == ("B: B malformed", "A: A malformed")


@pytest.mark.parametrize(
    ("what_if", "code"),
    [
        ([], "healthy"),
        (["dead: /lidar from 8s"], "silent"),
        (["dead: /camera from 8s", "dead: /lidar from 8s"], "silent"),
        (["offset: /camera 2s"], "other_clock"),
    ],
)
def test_findings_are_those_of_the_judge(tmp_path, what_if, code):
    assert found(tmp_path, {"findings": ["alone"]}, {**RATES, "what_if": what_if}) == {"findings": code}


@pytest.mark.parametrize(
    ("expected", "told"),
    [
        ({"match_rate": "< 98.765%"}, ("< 98.765%", "100%")),
        ({"match_rate": "< 0.9"}, ("< 0.9", "1")),
        ({"match_rate": "50%"}, ("50%", "100%")),
        ({"span_max": "> 1s"}, ("> 1s", "5ms")),
        ({"span_max": "< 4500us"}, ("< 4500us", "5000us")),
        ({"span_max": "> 0.02s"}, ("> 0.02s", "5ms")),
        ({"span_max": "== 0.02s"}, ("== 0.02s", "5ms")),
        ({"span_max": "< 0.004 s"}, ("< 0.004s", "5ms")),
        ({"span_max": "6ms"}, ("6ms", "5ms")),
        ({"span_max": 0.006}, ("6ms", "5ms")),
        ({"latency_max": "> 1min"}, ("> 1min", "0min")),
    ],
)
def test_figures_are_told_in_the_unit_that_the_file_has(tmp_path, expected, told):
    (mismatch,) = run(tmp_path, {**RATES, "expect": expected}).mismatches
    assert (*mismatch.expected, *mismatch.found) == told


@pytest.mark.parametrize(
    ("case", "error"),
    [
        (
            {"what_if": ["dead: /camera", "dead: /lidar"], "expect": {"drops": {"late": 0}}},
            "no message came to the group",
        ),
        ({"lasts": "2s", "expect": {"findings": ["healthy"]}}, "last 2 s, so they cannot test `findings`"),
    ],
)
def test_what_could_not_fail_is_an_error(tmp_path, case, error):
    result = run(tmp_path, {**RATES, **case})
    assert error in result.error
    assert not result.passed


_DEAD = ["dead: /camera", "dead: /lidar"]
_DROPS_ALL = {"camera": {"rate": "10 Hz", "drop": "100%"}, "lidar": {"rate": "30 Hz"}}
_THIRDS = {"drawing": "camera |abc\nlidar  |A.........BC\n"}
_ONE_IN_THREE = {"drawing": "camera |abc\nlidar  |A..\n", "inputs": {"lidar": {"latency": "1ms"}}}


@pytest.mark.parametrize(
    ("case", "expect", "told"),
    [
        (RATES, {"sets": ">= 200", "match_rate": "100%", "span_p95": "< 6ms", "drops": {"overflow": 0}}, {}),
        (RATES, {"findings": ["healthy"]}, {}),
        ({**RATES, "what_if": _DEAD}, {"received": 0}, {}),
        ({"inputs": _DROPS_ALL, "lasts": "2s"}, {"received": 1}, {"received": "60"}),
        ({"inputs": {"camera": {"rate": "100 kHz"}}, "lasts": "0.3s"}, {"received": 1}, {"received": "30000"}),
        (_ONE_IN_THREE, {"match_rate": "> 98%"}, {}),
        (_THIRDS, {"match_rate": "> 98%"}, {"match_rate": "33.33%"}),
        # All but one are not all.
        (
            {**RATES, "lasts": "2500s", "what_if": ["dead: /camera from 9.95s until 10.05s"]},
            {"inputs": {"lidar": {"match_rate": 1}}},
            {"match_rate": "0.9999"},
        ),
    ],
)
def test_what_differs_from_what_was_expected_is_told_and_nothing_else(tmp_path, case, expect, told):
    assert found(tmp_path, expect, case) == told


def test_without_a_set_there_is_no_span_to_expect(tmp_path):
    result = run(tmp_path, {**RATES, "what_if": ["dead: /lidar"], "expect": {"span_p95": "< 1ms"}})
    assert [each.found for each in result.mismatches] == [("no set left",)]


def test_losses_are_the_same_for_a_seed_and_others_for_another(tmp_path):
    case = {**RATES, "what_if": ["drop: /camera 30%"]}
    first, again, other = (found(tmp_path, {"sets": 1}, {**case, "seed": seed})["sets"] for seed in (1, 1, 2))
    assert first == again != other
    assert 100 < int(first) < 180


def test_a_recording_is_run_as_replay_runs_it(tmp_path):
    write_mcap(tmp_path / "rig.mcap", rig())
    expect = {"sets": 1, "match_rate": 0, "findings": ["silent"], "inputs": {"camera": {"received": 1}}}
    assert found(tmp_path, expect, {"recording": "rig.mcap"}, **RECORDED) == {
        "sets": "40",
        "match_rate": "1",
        "received": "40",
        "findings": "healthy",
    }
    for name in ("/lidar", "lidar"):
        dead = {"recording": "rig.mcap", "what_if": [f"dead: {name} from 2s"]}
        assert found(tmp_path, {"sets": 1}, dead, **RECORDED) == {"sets": "20"}


@st.composite
def lanes(draw):
    """Draw two lanes of letters, in the order of the alphabet by column."""
    columns = draw(st.lists(st.sampled_from(("..", "x.", ".x", "xx")), min_size=1, max_size=9))
    letters = iter("abcdefghijklmnopqr")
    marked = ["".join(next(letters) if mark == "x" else "." for mark in column) for column in columns]
    return tuple("".join(column[lane] for column in marked) for lane in (0, 1))


@given(drawn=lanes(), policy=st.sampled_from(("approximate_time", "approximate_time_eager", "exact_time")))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_drawing_gives_what_the_engine_gives_by_hand(tmp_path, drawn, policy):
    camera, lidar = drawn
    group = {"policy": policy, "slop": None if policy == "exact_time" else "20ms", "queue_size": 3}
    assume(set(camera + lidar) != {"."})
    told = left(tmp_path, f"camera |{camera}\nlidar  |{lidar}\n", **group)
    engine = load(str(tmp_path / "fusion.yaml")).groups[0].engine()
    expected = []
    for column, marks in enumerate(zip(camera, lidar, strict=True)):
        for index, letter in enumerate(marks):
            if letter != ".":
                stamp = 10**18 + column * 10_000_000
                outcomes = engine.add(Message(index, stamp, letter), now=stamp)
                expected += [(letter, each) for each in outcomes]
    by_letter = [(line[0], each) for line in told for each in line[3:].split(", ")]
    assert by_letter == [(letter, in_words(outcome)) for letter, outcome in expected]


def in_words(outcome):
    if isinstance(outcome, Match):
        return "".join(message.payload for message in outcome.messages if message is not None)
    return f"{outcome.message.payload} {outcome.reason.value}"
