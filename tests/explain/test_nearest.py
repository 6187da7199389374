"""The nearest sets, against a slow and obvious search through all sets that there could be."""

from bisect import bisect_right
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.config import Distance
from syncrelay.explain.nearest import NearestSpans, in_order, shifted, signed_distances
from syncrelay.explain.possible_sets import possible_sets
from syncrelay.explain.received import Received, as_arrays
from syncrelay.explain.rows import BLOCK
from syncrelay.sync import Message
from tests.explain.scenario import BEGAN, MS, Source, group_of

STAMPS = st.lists(st.integers(0, 60), min_size=1, max_size=7, unique=True).map(sorted)
STREAMS = st.lists(STAMPS, min_size=2, max_size=4)


def measured(streams, pivot):
    """The pivot's messages with something of every input not after and not before them."""
    first, last = max(stream[0] for stream in streams), min(stream[-1] for stream in streams)
    return [stamp for stamp in streams[pivot] if first <= stamp <= last]


def tightest_of_all(streams, pivot):
    """For each message of the pivot, the least span of all sets that hold it."""
    spans = []
    for stamp in measured(streams, pivot):
        others = [stream for index, stream in enumerate(streams) if index != pivot]
        spans.append(min(max(stamp, *chosen) - min(stamp, *chosen) for chosen in product(*others)))
    return spans


def oldest_of_the_latest(streams, pivot):
    """For each message of the pivot, the age of the oldest of the others' latest messages that are not newer."""
    others = [stream for index, stream in enumerate(streams) if index != pivot]
    return [
        max(stamp - max(other for other in stream if other <= stamp) for stream in others)
        for stamp in measured(streams, pivot)
    ]


@st.composite
def chunked(draw, streams):
    """The streams cut into chunks at moments that all share, each chunk in any order."""
    cuts = [*sorted(draw(st.lists(st.integers(0, 60), max_size=6))), 60]
    chunks = []
    done = [0] * len(streams)
    for cut in cuts:
        ends = [bisect_right(stream, cut) for stream in streams]
        pieces = [stream[start:end] for stream, start, end in zip(streams, done, ends, strict=True)]
        chunks.append([draw(st.permutations(piece)) for piece in pieces])
        done = ends
    return chunks


@pytest.mark.parametrize(
    ("distance", "reference"),
    [(Distance.SPAN, tightest_of_all), (Distance.AGE, oldest_of_the_latest)],
    ids=["tightest span", "greatest age"],
)
@given(cases=st.data())
def test_it_is_what_a_search_through_all_sets_finds_in_whatever_chunks_the_stamps_come(distance, reference, cases):
    streams = cases.draw(STREAMS)
    pivot = cases.draw(st.integers(0, len(streams) - 1))
    nearest = NearestSpans(len(streams), distance)
    chunks = cases.draw(chunked(streams))
    with pytest.MonkeyPatch.context() as patched:
        # In plain Python, and in arrays.
        patched.setattr("syncrelay.explain.nearest._MANY", cases.draw(st.sampled_from((1, 1000))))
        assert [span for chunk in chunks for span in nearest.add(chunk, pivot=pivot)] == reference(streams, pivot)


@given(stamps=STAMPS, others=STAMPS)
def test_the_distance_to_the_nearest_of_others_is_known_of_what_lies_among_them(stamps, others):
    among = [stamp for stamp in stamps if others[0] < stamp <= others[-1]]
    nearest = [min((other - stamp for other in others), key=lambda by: (abs(by), by)) for stamp in among]
    assert signed_distances(np.array(stamps), np.array(others)).tolist() == nearest


def test_stamps_of_a_long_recording_are_put_in_order_whatever_their_order_was():
    rng = np.random.default_rng(1)
    stamps = BEGAN + np.arange(5 * BLOCK) * MS + rng.integers(-3, 4, 5 * BLOCK) * MS
    # A clock that was set back, messages without a stamp, and a field that holds any number.
    stamps[3 * BLOCK :] -= 2 * BLOCK * MS
    stamps[:: BLOCK // 3] = 0
    stamps[7::BLOCK] = 2**63 - 1
    places = np.arange(len(stamps)) * 2
    found = in_order(Received(stamps, stamps, places), 5)
    expected, last = np.unique(stamps[stamps != 0][::-1], return_index=True)
    assert np.array_equal(found.stamps[:], shifted(expected, 5))
    assert np.array_equal(found.places[:], places[stamps != 0][::-1][last])


@pytest.mark.parametrize(
    "policy", [{"policy": "approximate_time", "slop": "9ms"}, {"policy": "latest_time", "max_age": "9ms"}]
)
def test_possible_sets_are_the_same_whatever_stretches_they_are_found_in(policy, monkeypatch):
    rng = np.random.default_rng(1)
    periods = (30, 20, 7)
    came = sorted(
        (at * MS + int(rng.integers(5 * MS)), index, at * MS + int(rng.integers(20 * MS)))
        for index, period in enumerate(periods)
        for at in range(0, 6000, period)
        if rng.random() < 0.7
    )
    messages = [Message(index, BEGAN + stamp, BEGAN + at) for at, index, stamp in came]
    group = group_of(
        [Source(f"/{name}", 1) for name in "abc"], {**policy, **({"trigger": "/a"} if "max_age" in policy else {})}
    )
    whole, by_stretches = (_possible(group, messages, monkeypatch, size) for size in (BLOCK, 7))
    assert len(whole.stamps) > 50
    for name in ("stamps", "spans", "queues"):
        assert np.array_equal(getattr(whole, name)[:], getattr(by_stretches, name)[:]), name


def _possible(group, messages, monkeypatch, size):
    for name in ("possible_sets", "rows"):
        monkeypatch.setattr(f"syncrelay.explain.{name}.BLOCK", size)
    found = possible_sets(group, as_arrays(messages, 3), (0, 1, 2), is_window=False)
    assert found is not None
    return found


def test_after_clearing_nothing_of_before_counts():
    nearest = NearestSpans(2)
    nearest.add([[100], [101]], pivot=0)
    nearest.clear()
    assert nearest.add([[5, 15], [7, 17]], pivot=1) == [2]


def test_what_piles_up_while_an_input_is_silent_is_bounded():
    nearest = NearestSpans(2)
    for begin in range(0, 100_000, 1000):
        nearest.add([range(begin, begin + 1000), []], pivot=0)
    assert sum(map(len, nearest._stamps)) <= 5000  # noqa: SLF001  memory is the promise
    assert nearest.add([[], [99_998, 99_999]], pivot=1) == [0, 0]


def test_an_offset_does_not_turn_the_latest_stamp_into_the_earliest():
    (stamps, *_) = as_arrays([Message(0, 2**63 - 1, BEGAN)], 1)
    assert shifted(stamps.stamps[:], 1)[0] > 0


def test_stamps_beyond_64_bits_are_measured_like_any_others():
    nearest = NearestSpans(2)
    stamps = [2**80 + number * 10 for number in range(1000)]
    assert nearest.add([stamps, [stamp + 1 for stamp in stamps]], pivot=1) == [1] * 999
