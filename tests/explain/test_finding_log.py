"""What is worth a line in the log, and when."""

from dataclasses import replace

import pytest

from syncrelay.explain import Code, Finding, FindingLog, GroupFacts, Severity, in_words, judge
from syncrelay.explain.finding_log import Remark
from syncrelay.explain.report import GroupReport
from syncrelay.explain.standing import Standing
from syncrelay.explain.summary import log_summary
from tests.explain.support.groups import BEGAN, NOW, S, a_group, an_input

DEAD = {"publishers": (), "figures": {"last_received": None, "rate_hz": 0.0}}
WHO = "nobody publishes /camera (sensor_msgs/msg/Image)"
WHY = f"{WHO}; start the node that publishes /camera, or correct the topic's name"


def at(second: float, *, last_set: float | None, **facts) -> GroupFacts:
    """A group whose camera is missing, so many seconds after the start."""
    figures = {"now": BEGAN + round(second * S), "last_set": None if last_set is None else BEGAN + round(last_set * S)}
    return a_group(an_input("/camera", **DEAD), an_input("/lidar"), figures={**figures, "best_hz": 0.0, **facts})


def looked(silence, facts):
    return list(silence.remarks(facts, judge(facts)))


def told(silence, seconds, *, last_set):
    """At which of these seconds something was said, of sets that left at `last_set(second)`."""
    return [second for second in seconds if looked(silence, at(second, last_set=last_set(second)))]


def test_no_pause_is_longer_than_ten_minutes():
    seconds = told(FindingLog(), range(5, 4000, 5), last_set=lambda _: None)
    assert seconds[-4:] == [1840, 2440, 3040, 3640]


def test_a_silence_is_said_with_its_reason_and_what_to_do():
    (remark,) = looked(FindingLog(), at(7, last_set=None))
    assert (remark.severity, remark.text, remark.code) == (Severity.WARN, f"no set for 7 s: {WHY}", Code.NO_PUBLISHER)
    assert looked(FindingLog(), at(17, last_set=10))[0].text == f"no more sets for 7 s: {WHY}"


def test_its_end_is_said_once():
    silence = FindingLog()
    looked(silence, at(5, last_set=None))
    assert looked(silence, at(9, last_set=8.9)) == [Remark(Severity.OK, "recovered after 9 s")]
    assert looked(silence, at(10, last_set=9.9)) == []


def warned(silence, seconds, *findings):
    facts = [a_group(figures={"now": NOW + second * S, "last_set": NOW + second * S}) for second in seconds]
    lines = []
    for second, each in zip(seconds, facts, strict=True):
        lines += [(second, remark.text) for remark in silence.remarks(each, findings)]
    return lines


REPEATS = Finding(Code.DUPLICATES, Severity.WARN, "stamps repeat", "look there", 0)


def test_a_warning_of_each_input_is_said():
    other = Finding(Code.DUPLICATES, Severity.WARN, "others repeat", None, 1)
    assert warned(FindingLog(), range(100), REPEATS, other) == [(5, "stamps repeat; look there"), (5, "others repeat")]


def test_the_end_of_a_warning_is_said_once_in_its_last_words():
    silence = FindingLog()
    warned(silence, range(10), REPEATS)
    warned(silence, [10], Finding(Code.DUPLICATES, Severity.WARN, "stamps repeat still", None, 0))
    assert warned(silence, range(11, 40)) == [(20, "resolved 10 s ago: stamps repeat still")]


def test_what_another_finding_explains_is_not_over():
    silence = FindingLog()
    warned(silence, range(10), REPEATS)
    hidden = [a_group(figures={"now": NOW + second * S, "last_set": NOW + second * S}) for second in range(10, 40)]
    assert [line for facts in hidden for line in silence.remarks(facts, (), {Code.DUPLICATES})] == []
    assert warned(silence, range(40, 60)) == [(49, "resolved 10 s ago: stamps repeat")]


@pytest.mark.parametrize(("suggestion", "line"), [(None, "so it is"), ("do this", "so it is; do this")])
def test_a_finding_is_one_line(suggestion, line):
    assert in_words(Finding(Code.HEALTHY, Severity.OK, "so it is", suggestion)) == line


# When the group gives sets, and when stamps repeat: both come back within a minute and after more.
WELL = (range(50, 75), range(100, 170), range(190, 300))
REPEATING = (range(52, 60), range(105, 135), range(200, 240))


def played(set_back: int):
    """What is said, and when, with a clock that is set back by an hour in this second."""
    log, lines, last_set = FindingLog(), list[tuple[int, str]](), None
    for second in range(1, 300):
        by = 3600 if second >= set_back else 0
        last_set = second if any(second in each for each in WELL) else last_set
        facts = at(second - by, last_set=None if last_set is None else last_set - by, began=BEGAN - by * S)
        found = (REPEATS,) if any(second in each for each in REPEATING) else ()
        lines += [(second, each.text.partition(" ")[0]) for each in log.remarks(facts, (*judge(facts), *found))]
    return lines


@pytest.mark.parametrize("set_back", [3, 30, 55, 58, 62, 90, 110, 138, 150, 172, 210, 242])
def test_a_clock_that_is_set_back_delays_nothing_by_more_than_a_look(set_back):
    usual, lines = played(1000), played(set_back)
    assert [text for _, text in lines] == [text for _, text in usual]
    assert all(0 <= later - sooner <= 2 for (sooner, _), (later, _) in zip(usual, lines, strict=True))


@pytest.fixture
def summary(caplog):
    def said(log):
        caplog.clear()
        with caplog.at_level("INFO", "syncrelay"):
            log_summary([GroupReport(at(100, last_set=99), (), log=log)])
        return [line.partition(":   ")[2] for line in caplog.messages if "the start" in line or "earlier" in line]

    return said


def test_what_was_wrong_is_said_once_more_at_the_end(summary):
    log = FindingLog()
    looked(log, at(5, last_set=None))
    assert summary(log) == [f"from the start, until the end: no sets: {WHO}"]
    # Sets leave again, but too few to say so yet; then none, and then enough.
    for second, last_set in ((7, 6), (8, 7.5)):
        looked(log, replace(at(second, last_set=last_set), standing=Standing.FEW))
        assert summary(log) == [f"from the start, for 6 s: no sets: {WHO}"]
    looked(log, at(20, last_set=8))
    assert summary(log) == [f"from the start, until the end: no sets: {WHO}"]
    looked(log, at(21, last_set=20.9))
    assert summary(log) == [f"from the start, for 21 s: no sets: {WHO}"]


def test_of_what_was_wrong_often_the_last_five_are_said(summary):
    log = FindingLog()
    for begin in range(0, 700, 100):
        told(log, range(begin, begin + 30), last_set=lambda _, begin=begin: begin)
        looked(log, at(begin + 32, last_set=begin + 31))
    first, *others = summary(log)
    assert first == "2 earlier findings in the log above"
    assert [each.partition(" after")[0] for each in others] == ["3 min", "5 min", "7 min", "8 min", "10 min"]


def test_a_clock_that_is_set_back_moves_nothing_in_the_summary(summary):
    log = FindingLog()
    told(log, range(30, 50), last_set=lambda _: 30)
    looked(log, at(-3550, last_set=None))
    looked(log, at(-3545, last_set=-3546))
    assert summary(log) == [f"30 s after the start, for 24 s: no sets: {WHO}"]
