"""What is seen of streams: rates, delays, faults, windows; and that memory stays bounded."""

from collections.abc import Sequence
from operator import add
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.explain.input_observation import InputObservation
from syncrelay.explain.observation import Observation
from syncrelay.sync.counts import InputCounts
from syncrelay.sync.messages import DropReason
from tests.explain.scenario import Source, group_of
from tests.explain.support.groups import BEGAN, MS, S


def observation(offsets: Sequence[int], required: Sequence[bool]) -> Observation:
    """The observation of a group whose inputs have these offsets in nanoseconds."""
    sources = [
        Source(f"/in{index}", hz=1, required=needed, topic_options={"offset": f"{offset}ns"})
        for index, (offset, needed) in enumerate(zip(offsets, required, strict=True))
    ]
    return Observation(group_of(sources, {"slop": "20ms", "max_wait": "100ms"}), began=BEGAN)


class Stage:
    """An observation of inputs, fed second by second as a relay is."""

    def __init__(self, n_inputs=2, *, offsets=None, required=None):
        self.n_inputs = n_inputs
        self.now = BEGAN
        self.observation = observation(offsets or [0] * n_inputs, required or [True] * n_inputs)
        self.fed = [0] * n_inputs
        self.dropped: list[dict[DropReason, int]] = [{} for _ in range(n_inputs)]
        self.sets = 0

    def second(self, *streams, sets=(), dropped=None, length=S):
        """One look: what came on each input in this second, as (stamp, time of receipt)."""
        self.now += length
        arrivals = [*streams, *[[]] * (self.n_inputs - len(streams))]
        self.fed = [fed + len(came) for fed, came in zip(self.fed, arrivals, strict=True)]
        self.sets += len(sets)
        for reason, count in (dropped or {}).items():
            self.dropped[0][reason] = self.dropped[0].get(reason, 0) + count
        counts = [InputCounts(fed, 0, dict(gone), 0) for fed, gone in zip(self.fed, self.dropped, strict=True)]
        self.observation.add(arrivals, sets, counts, self.sets, now=self.now)

    def stream(self, hz, *, shift=0):
        """The messages of the second to come."""
        stamps = [self.now + n * S // hz + shift for n in range(hz)]
        return [(stamp, stamp - shift + 2 * MS) for stamp in stamps]

    @property
    def group(self):
        return self.observation.figures(now=self.now)[0]

    @property
    def inputs(self):
        return self.observation.figures(now=self.now)[1]


def a_set(stage, *, span=5 * MS, latency=MS, second=True):
    return (stage.now, stage.now + span if second else None), latency


_STAMPS = st.lists(st.sampled_from([0, *range(BEGAN, BEGAN + 20)]), min_size=1, max_size=12)


@given(_STAMPS, _STAMPS)
def test_what_comes_at_once_is_judged_as_what_comes_one_by_one(first, second):
    def seen(*looks):
        one = InputObservation()
        for look in looks:
            one.add(look)
        return one.figures(fed=0, dropped={}, seconds=1, now=BEGAN + S)

    came = [(stamp, BEGAN + 100 + place) for place, stamp in enumerate(first + second)]
    at_once = seen(came[: len(first)], came[len(first) :])
    one_by_one = seen(*[[each] for each in came])
    for figure in ("duplicates", "out_of_order", "delay", "jitter", "longest_pause", "last_received", "fell_at"):
        assert getattr(at_once, figure) == getattr(one_by_one, figure)


@given(
    st.lists(st.tuples(*[st.integers(BEGAN, BEGAN + 20)] * 3), min_size=1, max_size=8),
    st.tuples(*[st.integers(-9, 9)] * 3),
)
def test_spans_of_whole_sets_are_those_of_sets_one_by_one(sets, offsets):
    seen = observation(offsets, [True, True, False])
    nothing = [InputCounts(0, 0, {}, 0)] * 3
    seen.add([[]] * 3, [(stamps, 0) for stamps in sets], nothing, len(sets), now=BEGAN + S)
    spans = [max(shifted) - min(shifted) for shifted in (list(map(add, stamps, offsets)) for stamps in sets)]
    assert list(seen.figures(now=BEGAN + S)[0].spans.newest(99)) == spans[::-1]


def test_memory_does_not_grow_with_time():
    stage = Stage()

    def held():
        observation = stage.observation
        kept: list[Any] = [observation._polls, observation._spans, observation._latencies, observation._nearest]  # noqa: SLF001  memory is the promise
        for each in observation.inputs:
            kept += [each._stamps, each._received, each._delays, each._order._faults, each._points]  # noqa: SLF001
        return sum(map(len, kept))

    for _ in range(330):
        stage.second(stage.stream(10), stage.stream(20), sets=[a_set(stage)] * 10)
    after_a_while = held()
    for _ in range(200):
        stage.second(stage.stream(10), stage.stream(20), sets=[a_set(stage)] * 10)
    assert held() == after_a_while


_LOOKS = st.lists(
    st.tuples(
        st.sampled_from([1, 1, 2, 2, 3, 6, 10, 20, 21]),
        st.integers(0, 3),
        st.lists(st.booleans(), max_size=4),
        st.integers(0, 2),
        st.sampled_from([False, False, False, True]),
    ),
    min_size=1,
    max_size=30,
)


@given(_LOOKS)
def test_figures_are_those_of_the_looks_of_the_last_ten_seconds(looks):
    """Against all looks that there were: half seconds since the last, messages, sets with the optional input, drops."""
    stage = Stage(required=[True, False])
    history = [(BEGAN, 0, 0, list[bool](), 0)]
    last_set = resumed = None
    fed = dropped = 0
    for halves, came, sets, drops, resumes in looks:
        if resumes:
            stage.observation.begin_sets_anew(stage.now)
            resumed = stage.now
        now = stage.now + halves * S // 2
        # Sets begin again with the first, and with the next after a silence of 5 s that two looks have seen.
        if sets and (last_set is None or (now - last_set >= 5 * S and not history[-1][3])):
            resumed = now
        last_set = now if sets else last_set
        fed, dropped = fed + came, dropped + drops
        history.append((now, fed, history[-1][2] + len(sets), sets, dropped))
        stage.second(
            [(BEGAN + fed - n, now) for n in range(came)],
            sets=[a_set(stage, second=has_optional) for has_optional in sets],
            dropped={DropReason.LATE: drops} if drops else {},
            length=halves * S // 2,
        )
        group, (one, _) = stage.observation.figures(now=now)
        begin = max((each for each in history[:-1] if each[0] <= now - 10 * S), default=history[0])
        assert (one.fed, one.dropped.get(DropReason.LATE, 0)) == (fed - begin[1], dropped - begin[4])
        if resumed is not None and begin[0] < resumed < now:
            begin = next(each for each in history if each[0] >= resumed)
        assert group.rate_hz == (history[-1][2] - begin[2]) * S / (now - begin[0])
        recent = [has for at, _, _, sets, _ in history for has in sets if at > now - 10 * S]
        assert group.missing == (0, recent.count(False) / max(1, len(recent)))
        whole = [has for _, _, _, sets, _ in history for has in sets]
        assert group.sets_since_without[1] == next((n for n, has in enumerate(whole[::-1]) if not has), len(whole))
        assert (group.last_set, group.resumed, group.sets) == (last_set, resumed, len(whole))


def test_of_an_input_that_ended_nothing_is_awaited():
    observation = InputObservation()
    for second in range(20):
        observation.add([(BEGAN + second * S + n * S // 10, BEGAN + second * S + n * S // 10) for n in range(10)])
    observation.add([(BEGAN + 20 * S, BEGAN + 20 * S + 300 * MS)])
    awaited = [
        observation.figures(fed=10, dropped={}, seconds=10, now=BEGAN + after * S).may_step for after in (21, 40)
    ]
    assert awaited == [True, False]


@given(kept=st.integers(0, 20), hz=st.integers(1, 200), count=st.integers(20, 100))
def test_what_a_latched_publisher_had_kept_is_in_no_rate(kept, hz, count):
    seen, period = InputObservation(), S // hz
    live = [BEGAN + n * period for n in range(count)]
    seen.add([(BEGAN - (kept - n) * period, BEGAN + n * MS // 100) for n in range(kept)])
    seen.add([(at, at + period // 2) for at in live])
    figures = seen.figures(fed=kept + count, dropped={}, seconds=10.0, now=live[-1] + period)
    assert figures.usual_hz == pytest.approx(hz, rel=1 / count)
