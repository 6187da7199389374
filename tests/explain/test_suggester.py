"""Suggestions: each was tried on the messages that came, cures what it is said of, and gives what it promises."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from syncrelay.explain import UNREADABLE, Code, Finding, FindingLog, Severity
from syncrelay.explain.changes import Change
from syncrelay.explain.other_stamps import by_other_stamps
from syncrelay.explain.received import Messages, as_arrays
from syncrelay.explain.suggester import Suggester
from syncrelay.explain.trials import REQUIRED, Trials, Tried, Verdict
from syncrelay.explain.try_budget import OutOfTimeError, TryBudget
from syncrelay.sync import Message
from tests.explain.scenario import BEGAN, MS, Source, Told, group_of, run
from tests.explain.support.groups import NOW, S, a_group
from tests.faults.extent import chosen

_VALUES = re.compile(r"(`[^`]+: [^`]+`(?: at /\w+)?(?: and `[^`]+: [^`]+`(?: at /\w+)?)*), which would give (\d+)")
_VALUE = re.compile(r"`(\w+): ([^`]+)`(?: at (/\w+))?")


def offers(finding: Finding) -> list[tuple[list[tuple[str, str, str]], int]]:
    """What a finding suggests to write, and how many sets that would give."""
    found = _VALUES.findall(finding.suggestion or "")
    return [(_with_topics(_VALUE.findall(values)), int(promised)) for values, promised in found]


def _with_topics(values: list[tuple[str, str, str]]) -> list[tuple[str, str, str]]:
    """Of several values for one topic, the last names it."""
    return [(key, value, values[-1][2] if key == "clock" else topic) for key, value, topic in values]


def written(sources: list[Source], options: dict, values: list[tuple[str, str, str]]):
    """The rig with these values in its file."""
    options = {**options, **{key: yaml_value(value) for key, value, topic in values if not topic}}
    of_topic = [(each, {key: value for key, value, topic in values if topic == each.topic}) for each in sources]
    return [replace(each, topic_options=each.topic_options | written) for each, written in of_topic], options


def yaml_value(value: str):
    return int(value) if value.isdigit() else value


def rig(*sources: Source, seconds: int = 30, **options) -> tuple[Told, list[tuple[Finding, Told, int]]]:
    """What is told of a rig, and for each offer of its last findings what is told with the values written."""
    told = run(*sources, seconds=seconds, options=options)
    cured = []
    for finding in told.found[-1][1]:
        for values, promised in offers(finding):
            better, changed = written(list(sources), options, values)
            cured.append((finding, run(*better, seconds=seconds, options=changed), promised))
    return told, cured


def assert_cured(cured: list[tuple[Finding, Told, int]], *, offered: int) -> None:
    assert len(cured) == offered
    for finding, told, promised in cured:
        assert told.warnings == []
        assert finding.code not in {each.code for each in told.found[-1][1]}
        assert told.facts.figures.sets >= promised


CAMERA = Source("/camera", hz=10, jitter_ms=0.5)
LIDAR = Source("/lidar", hz=10, jitter_ms=0.5)


def test_a_clock_whose_least_delay_decides_what_matches_is_not_offered_to_be_mapped_but_the_delay_is_asked_for():
    """The camera's 7 ms are less than a period of its own and several of the lidar's: nothing shows which of these."""
    quick = Source("/lidar", hz=500, delay_ms=0.5)
    camera = Source("/camera", hz=50, delay_ms=7, stamp=lambda stamp: stamp - BEGAN + 300 * S)
    told, cured = rig(camera, quick, slop="1ms")
    assert cured == []
    assert told.codes == {"other_clock"}
    assert (told.found[-1][1][0].suggestion or "").endswith(
        "; if you know how long messages of /camera take at least to arrive, which decides what they match, map its"
        " stamps with the keys `clock` and `delay`"
    )
    # That of a clock which was of the host's time before is known.
    restarts = replace(camera, stamp=lambda stamp: stamp if stamp < BEGAN + 15 * S else stamp - BEGAN)
    _, cured = rig(restarts, quick, slop="1ms")
    offered = {finding.code: values for finding, _, _ in cured for values, _ in offers(finding)}
    mapped = [("clock", "device", "/camera"), ("delay", "7ms", "/camera")]
    assert offered == {Code.OTHER_CLOCK: mapped, Code.TIME_JUMP: mapped}
    assert_cured(cured, offered=2)


def test_stamps_that_were_never_set_or_cannot_be_read_stay_so_where_the_others_are_tried_as_mapped():
    config = group_of([CAMERA, LIDAR], {"slop": "5ms"})
    camera = [Message(0, NOW + n * 100 * MS, NOW + n * 100 * MS + 5 * MS) for n in range(100)]
    lidar = [Message(1, 300 * S + n * 100 * MS, NOW + n * 100 * MS + 42 * MS) for n in range(100)]
    for place, unset in ((40, 0), (60, 0), (80, UNREADABLE)):
        lidar[place] = replace(lidar[place], stamp=unset)
    messages = sorted([*camera, *lidar], key=lambda each: each.payload)
    trials = Trials(config, as_arrays(messages, 2), is_window=True)
    (found,) = by_other_stamps(trials, 1).tried
    assert found.changes == (Change("clock", "device", 1), Change("delay", "42ms", 1))
    # Of the first and the last, it is not known whether a partner is still to come.
    assert found.given == found.possible == 97


def test_a_slop_is_not_narrowed_to_how_near_mapped_stamps_came():
    messages = [
        Message(index, NOW + n * 100 * MS + index * MS, NOW + n * 100 * MS + 5 * MS)
        for n in range(100)
        for index in (0, 1)
    ]

    def plan(lidar: Source) -> list[str]:
        config = group_of([CAMERA, lidar], {"slop": "20ms"})
        trials = Trials(config, as_arrays(messages, 2), is_window=False)
        return [each.key for each in trials.plan]

    assert plan(LIDAR) == ["slop"]
    assert plan(replace(LIDAR, topic_options={"clock": "device"})) == []


def a_suggester(budget: TryBudget | None = None) -> Suggester:
    """Of a group whose stamps lie 30 ms apart, with a slop of 20 ms."""
    config = group_of([CAMERA, LIDAR], {"slop": "20ms"})
    stamps = [BEGAN + number * 100 * MS for number in range(60)]
    arrivals = [[(stamp + shift, stamp + 40 * MS) for stamp in stamps] for shift in (0, 30 * MS)]
    return Suggester(config, lambda: arrivals, budget)


def wider(trials: Trials) -> Verdict:
    return trials.verdict(REQUIRED, {"slop"})


def nothing(_: Trials) -> Verdict:
    return Verdict(())


def test_what_was_tried_is_not_tried_again_at_once():
    asked = a_suggester()
    first = asked.ask("a", wider, now=BEGAN)
    assert asked.ask("a", nothing, now=BEGAN + 999 * MS) is first
    assert asked.ask("a", nothing, now=BEGAN + 1000 * MS).tried == ()


class Processor:
    """A clock of the processor that takes 3 ms each time it is read."""

    def __init__(self) -> None:
        self.now = 0

    def __call__(self) -> int:
        self.now += 3 * MS
        return self.now


def test_nothing_is_tried_for_any_group_once_the_budget_is_spent_until_it_is_refilled():
    budget = TryBudget(clock := Processor())
    asked, other = a_suggester(budget), a_suggester(budget)
    clock.now += 40 * MS
    assert asked.ask("a", wider, now=BEGAN).tried == other.ask("a", wider, now=BEGAN).tried == ()
    budget.refill()
    assert asked.ask("a", wider, now=BEGAN).tried != ()


TOO_WIDE = (Code.OVER_SLOP, None)


def told_at(seconds, asked, severity, last_set):
    """At which of these seconds the log speaks of what is too wide, which is asked about at each."""
    log, told = FindingLog(), []
    for second in seconds:
        now = NOW + second * S
        asked(second).ask(TOO_WIDE, wider, now=now)
        facts = a_group(figures={"now": now, "last_set": last_set(now)}, suggester=asked(second))
        finding = Finding(Code.OVER_SLOP, severity, "too wide")
        told += [second for _ in log.remarks(facts, (finding,))]
    return told


@pytest.mark.parametrize(("severity", "last_set"), [(Severity.WARN, lambda now: now), (Severity.ERROR, lambda _: NOW)])
def test_the_log_waits_until_there_was_time_to_try_something_but_not_for_ever(severity, last_set):
    budget = TryBudget(clock := Processor())
    clock.now += 40 * MS
    asked = a_suggester(budget)

    def free_at(second):
        if second == 8:
            budget.refill()
        return asked

    assert told_at(range(10), lambda _: a_suggester(), severity, last_set) == [5]
    assert told_at(range(10), free_at, severity, last_set) == [8]
    clock.now += 40 * MS
    hopeless = a_suggester(budget)
    assert told_at(range(18), lambda _: hopeless, severity, last_set) == [15]


def slops(trials: Trials) -> Verdict:
    for slop in range(21, 90):
        trials.given((Change("slop", f"{slop}ms"),))
    return wider(trials)


def test_a_poll_interrupts_what_takes_long_and_the_next_goes_on_from_there():
    budget = TryBudget(clock := Processor())
    asked = a_suggester(budget)
    polls = 0
    found: tuple[Tried, ...] = ()
    while not found and polls < 100:
        began = clock.now
        found = asked.ask("a", slops, now=BEGAN).tried
        assert clock.now - began < 100 * MS
        budget.refill()
        polls += 1
    assert polls > 1
    assert found == a_suggester().ask("a", slops, now=BEGAN).tried


def test_the_first_run_of_a_poll_ends_however_slow_the_processor_is():
    budget = TryBudget(clock := Processor())
    messages = Messages(*np.zeros((3, 1000), dtype=np.int64))
    first = budget.spent_on([messages])
    begun = len(next(first).inputs)
    assert begun < 1000
    clock.now += 1000 * MS
    assert begun + sum(len(each.inputs) for each in first) == 1000
    with pytest.raises(OutOfTimeError):
        list(budget.spent_on([messages]))


def test_what_was_never_tried_comes_before_what_was():
    budget = TryBudget(clock := Processor())
    asked, other = a_suggester(budget), a_suggester(budget)
    before = asked.ask("a", wider, now=BEGAN)
    clock.now += 40 * MS
    other.ask("a", wider, now=BEGAN)
    budget.refill()
    assert asked.ask("a", nothing, now=BEGAN + 2000 * MS) is before
    assert other.ask("a", wider, now=BEGAN + 2000 * MS).tried != ()
    budget.refill()
    assert asked.ask("a", nothing, now=BEGAN + 3000 * MS).tried == ()


_RATES = st.sampled_from([1, 2, 5, 7, 10, 15, 20, 30, 50, 100, 200])


@st.composite
def _sources(draw):
    return [
        Source(
            f"/s{number}",
            hz=draw(_RATES),
            delay_ms=draw(st.sampled_from([1, 5, 20, 80, 300, 700])),
            jitter_ms=draw(st.sampled_from([0, 0.2, 1, 3])),
            delay_jitter_ms=draw(st.sampled_from([0, 1, 5])),
            phase_ms=draw(st.sampled_from([0, 3, 12, 30, 70])),
        )
        for number in range(draw(st.integers(2, 4)))
    ]


@settings(max_examples=chosen(short=6, long=400), suppress_health_check=list(HealthCheck))
@given(_sources(), st.sampled_from([1, 5, 20, 60]), st.sampled_from([2, 10, 40]))
@pytest.mark.long
def test_whatever_is_suggested_gives_what_it_promises_and_cures(sources, slop_ms, queue_size):
    options = {"slop": f"{slop_ms}ms", "queue_size": queue_size}
    told = run(*sources, seconds=20, options=options)
    offered = [(finding, offer) for finding in told.found[-1][1] for offer in offers(finding)]
    assume(offered)
    for finding, (values, promised) in offered:
        better, changed = written(sources, options, values)
        then = run(*better, seconds=20, options=changed)
        assert then.facts.figures.sets >= promised, (finding, values)
        assert (finding.code, finding.input) not in {(each.code, each.input) for each in then.found[-1][1]}, finding


_OPTIONAL = st.sampled_from([None, 200, 600])


@settings(max_examples=chosen(short=6, long=400), suppress_health_check=list(HealthCheck))
@given(_sources(), st.sampled_from([1, 5, 20]), st.sampled_from([2, 10]), _OPTIONAL)
@pytest.mark.long
def test_all_findings_of_a_moment_name_one_value_for_a_key(sources, slop_ms, queue_size, late_ms):
    """The log, `observe` and /status show these findings: whatever they take from them is the same."""
    options = {"slop": f"{slop_ms}ms", "queue_size": queue_size}
    if late_ms:
        options["max_wait"] = "100ms"
        sources = [*sources, *(Source(f"/o{n}", hz=10, delay_ms=n * late_ms, required=False) for n in (1, 2))]
    for _, found in run(*sources, seconds=20, options=options).found:
        values = {value for finding in found for value in _VALUE.findall(finding.suggestion or "")}
        assert len({(key, topic) for key, _, topic in values}) == len(values), values
