"""Whatever comes, and whenever somebody looks, a group is judged: nothing in its messages or its clock is a bug."""

from hypothesis import given
from hypothesis import strategies as st

from syncrelay.explain import Endpoint, FindingLog, GroupWatch, InputGraph, Judge, Standstill, with_ok
from syncrelay.sync import Match, Message
from tests.explain.scenario import BEGAN, IMU, S, Source, group_of

_POLICIES = [
    {"policy": "approximate_time", "slop": "20ms"},
    {"policy": "exact_time"},
    {"policy": "latest_time", "trigger": "/a", "max_age": "1s"},
]
_NEAR = st.integers(-3 * S, 3 * S).map(lambda off: BEGAN + off)
# As many seconds as builtin_interfaces/Time holds.
_STAMPS = st.one_of(_NEAR, _NEAR, st.just(0), st.integers(-(2**31) * S, 2**31 * S - 1))
_MESSAGES = st.lists(st.tuples(st.integers(0, 1), _STAMPS), max_size=30)
_STEPS = st.one_of(st.integers(0, 3 * S), st.integers(-10 * S, 40 * S), st.integers(-(10**18), 10**18))
_LOOKS = st.lists(st.tuples(_STEPS, _MESSAGES, st.lists(st.booleans(), min_size=2, max_size=2)), max_size=15)


@given(st.sampled_from(_POLICIES), _LOOKS)
def test_whatever_comes_is_judged(options, looks):
    group = group_of([Source("/a", 10), Source("/b", 10)], options)
    engine, judge, log = group.engine(), Judge(), FindingLog()
    watch = GroupWatch(group, began=BEGAN)
    now = BEGAN
    for step, messages, are_served in looks:
        now += step
        arrivals: tuple[list[tuple[int, int]], ...] = ([], [])
        sets = []
        for place, (index, stamp) in enumerate(messages):
            received = now - step + step * place // len(messages)
            arrivals[index].append((stamp, received))
            outcomes = engine.add(Message(index, stamp, received), now=received)
            sets += [(each.stamps, received) for each in outcomes if isinstance(each, Match)]
        watch.add(arrivals, sets, engine.counts(), engine.sets, now=now)
        graph = [
            InputGraph(topic.topic, topic.output, publishers=(Endpoint("/driver", IMU),) if is_served else ())
            for topic, is_served in zip(group.topics, are_served, strict=True)
        ]
        facts = watch.facts(graph, now=now, standstills=[Standstill(now, abs(step))] if step < 0 else [])
        found = judge.judge(facts)
        list(log.remarks(facts, found, judge.explained(facts)))
        assert all(finding.text for finding in with_ok(facts, found))
