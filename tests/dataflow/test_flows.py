"""The compiled flow does what the one in Python does: the same messages leave, and the same is noted of them."""

from importlib import import_module
from importlib.util import find_spec

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from syncrelay.cdr import read_stamp
from syncrelay.dataflow.backend import PublishError
from syncrelay.dataflow.flow import RECENT
from syncrelay.explain import Tape
from syncrelay.sync import ApproximateTime, DropReason, Message, SyncGroup
from tests.dataflow.payloads import FLOWS, Named, Outlet, group_of
from tests.faults.extent import chosen
from tests.ros.cdr_messages import VECTOR, vector
from tests.ros.streams import BEGIN, MS
from tests.sync.support.rates import Rates
from tests.sync.support.rigs import POLICIES, Step, make_group, options, plain_options, steps
from tests.sync.test_vectors import CASES, SHIFT_NS
from tests.sync.test_vectors import make_policy as policy_of

pytestmark = pytest.mark.skipif(
    find_spec("syncrelay.ros.compiled.path") is None, reason="the compiled path was not built"
)

_TOPICS = ("/camera", "/lidar", "/imu")
_KEYED = [{"topic": topic, "type": VECTOR, "key": "vector.x"} for topic in _TOPICS]
_AT_ONCE = [
    {"policy": "exact_time", "queue_size": 3},
    {"policy": "approximate_time", "slop": "20ms", "queue_size": 3},
    {"policy": "approximate_time_eager", "slop": "20ms"},
]
_KINDS = [
    *_AT_ONCE,
    {"policy": "approximate_time", "slop": "20ms", "queue_size": 3, "restamp": "latest"},
    {"policy": "approximate_time_eager", "slop": "20ms", "max_wait": "5ms", "every": 2},
    {"policy": "latest_time", "trigger": "/camera", "max_age": "1s", "restamp": "/lidar"},
    {"policy": "equal_key", "queue_size": 3, "topics": _KEYED},
]
_MESSAGE = st.tuples(st.integers(0, 2), st.one_of(st.none(), st.integers(-30, 30)), st.booleans())
# As most come: one of each input, of one stamp or nearly; the last set may lack some.
_SPREADS = st.sampled_from(((0, 0, 0),) * 4 + ((0, 9, 3), (0, 21, 0)))
_STREAMS = st.lists(
    st.one_of(
        st.builds(
            lambda sets, ahead, lacking: [(index, ahead[index], False) for inputs in sets for index in inputs][
                :lacking
            ],
            st.lists(st.permutations(range(3)), min_size=1, max_size=12),
            _SPREADS,
            st.sampled_from((None, None, None, -1, -2)),
        ),
        st.lists(_MESSAGE, max_size=6),
        st.sampled_from(("tap", "listen", "pause", "count", "watch", "flush", "exchange")),
    ),
    max_size=20,
)


class _Listener:
    """Notes what it is told of sets, while it listens."""

    def __init__(self, noted) -> None:
        self.is_heard = False
        self._noted = noted

    def tell(self, flow, match, _latency) -> None:
        if self.is_heard:
            self._noted.append(("told", flow.n_sets, match.stamps, match.stamp))


class _Played:
    """A group of a flow, and all that can be seen of it."""

    def __init__(self, flow, keys, connected) -> None:
        self.noted: list[object] = []
        self._has_keys = keys["policy"] == "equal_key"
        self._now = 0
        self._tape = Tape()
        self._group = group_of(**{"topics": _TOPICS, **keys}, now=lambda: self._now, flow=flow, tape=self._tape)
        self._outlets = [Outlet(log=self.noted, place=index) for index in range(3)]
        self._connected = connected
        self._connect()
        self._listener = self._group.flow.manifests = _Listener(self.noted)

    @property
    def n_sets(self) -> int:
        return self._group.flow.n_sets

    def _connect(self) -> None:
        for index in self._connected:
            self._group.connect(index, self._outlets[index], restamped=index != 1)

    def play(self, stream):
        for each in stream:
            if isinstance(each, str):
                self._step_aside(each)
            else:
                begin = self._now // MS
                for index, ahead, refuses in each:
                    self._outlets[index].refusal = PublishError("no room") if refuses else None
                    # Messages of a set share a stamp.
                    came = begin + (self._now // MS - begin) // 3 * 3
                    self._receive(index, None if ahead is None else BEGIN + (10 * came + ahead) * MS)
        return self.seen()

    def _receive(self, index, stamp) -> None:
        count = self._now // MS
        key = count // 4 if self._has_keys and stamp is not None else None
        self._group.flow.receive(index, Named(count, BEGIN + count), stamp, key)
        self.noted.append((self._group.flow.n_sets, dict(self._group.unpublished), list(self._group.flow.keys)))
        self._now += MS

    def _step_aside(self, what) -> None:
        group = self._group
        if what == "tap":
            self._tape.is_on = not self._tape.is_on
        elif what == "listen":
            self._listener.is_heard = not self._listener.is_heard
        elif what == "pause":
            (group.pause if group.paused_since is None else group.unpause)()
        elif what == "count":
            self.noted.append((group.counts(), group.engine.sets))
        elif what == "watch":
            watched = group.flow.watched()
            self.noted.append((*map(list, watched.arrivals), [stamps for stamps, _ in watched.sets]))
        elif what == "flush":
            group.flush(DropReason.TIME_JUMP)
        else:
            group.suspend()
            self._receive(0, BEGIN + 10 * self._now)
            self._connect()
            group.resume()

    def seen(self):
        for last in ("watch", "count"):
            self._step_aside(last)
        group = self._group
        left = [(each.outcome, each.received) for each in self._tape.after(0, most=10_000)[0]]
        return [self.noted, list(group.flow.last), left, group.failure]


_IN_ORDER = [(index, 0, False) for index in range(3)]
# Who begins to listen, to tap or to watch while an engine lends.
_LOOKED_AT = [_IN_ORDER, "listen", _IN_ORDER, "listen", *[_IN_ORDER] * 9, "tap", _IN_ORDER, "tap", *[_IN_ORDER] * 9]


@given(keys=st.sampled_from(_KINDS), stream=_STREAMS, connected=st.sets(st.integers(0, 2)))
@example(keys=_AT_ONCE[0], stream=[*_LOOKED_AT, _IN_ORDER[:2], "watch", "count"], connected={0, 1})
@example(keys=_AT_ONCE[2], stream=[[(0, 0, False), (1, 21, False), (2, 0, False)], _IN_ORDER], connected={0, 1, 2})
def test_the_same_leaves_and_the_same_is_noted(keys, stream, connected):
    first, second = (_Played(flow, keys, connected).play(stream) for flow in FLOWS)
    assert first == second


@pytest.mark.parametrize("policy", POLICIES)
@given(data=st.data())
def test_the_same_leaves_of_any_engine(policy, data):
    chosen = data.draw(plain_options() | options())
    assume(chosen.n_inputs > 1)
    taken = data.draw(steps(chosen.n_inputs))
    first, second = (_left(flow, make_group(policy, chosen), taken, n_inputs=chosen.n_inputs) for flow in FLOWS)
    assert first == second


@pytest.mark.parametrize("seed", range(chosen(short=60, long=20_000)))
def test_the_same_leaves_of_streams_of_any_rates(seed):
    first, second = (_at_rates(flow, Rates(seed)) for flow in FLOWS)
    assert first == second


@pytest.mark.parametrize("far", [2**63, 2**80])
def test_a_stamp_that_a_field_gives_may_be_any_number(far):
    group = group_of(topics=["/a", "/b"], flow=FLOWS[-1])
    group.engine = SyncGroup(ApproximateTime(n_inputs=2, queue_size=5, slop_ns=10))
    group.flow.receive(0, Named(0, 0), 50)
    assert group.counts()[0].buffered == 1
    group.flow.receive(0, Named(1, 1), far)
    group.flow.receive(1, Named(2, 2), 49)
    assert group.counts()[0].buffered == 2


def _at_rates(flow, rates):
    """All that can be seen of approximate_time at a draw's rates, by somebody who looks now and then."""
    group = group_of(topics=[f"/input{index}" for index in range(rates.n_inputs)], now=lambda: 0, flow=flow)
    group.engine = SyncGroup(rates.policy())
    seen: list[object] = []
    looks = rates.looks(10)
    for index in range(rates.n_inputs):
        group.connect(index, Outlet(log=seen, place=index), restamped=False)
    for number, (index, stamp) in enumerate(rates.messages):
        group.flow.receive(index, Named(number, number), stamp)
        seen += [group.counts(), group.flow.n_sets] if number in looks else []
    watched = group.flow.watched()
    sets = [stamps for stamps, _ in watched.sets]
    held = group.engine.flush(DropReason.SHUTDOWN)
    return seen, list(group.flow.last), [*map(list, watched.arrivals)], sets, group.counts(), held, group.failure


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
def test_the_same_leaves_in_the_peers_own_cases(case):
    taken = [
        Step(now=0, message=Message(index, stamp + SHIFT_NS, number))
        for number, (index, stamp, *_) in enumerate(case["events"])
    ]
    first, second = (_left(flow, SyncGroup(policy_of(case)), taken, n_inputs=case["n_inputs"]) for flow in FLOWS)
    assert first == second


def _left(flow, engine, taken, *, n_inputs):
    """What leaves of an engine, and where its messages went after each step."""
    now = [0]
    group = group_of(topics=[f"/input{index}" for index in range(n_inputs)], now=lambda: now[0], flow=flow)
    # What an engine holds goes with it.
    group.flow.receive(0, Named("before"), SHIFT_NS)
    group.engine = engine
    seen = []
    for number, step in enumerate(taken):
        now[0] = step.now
        if step.message is None:
            group.expire(step.now)
        else:
            payload = Named(step.message.payload, number)
            group.flow.receive(step.message.input, payload, step.message.stamp, step.message.key)
        seen.append(group.flow.n_sets)
    return seen, list(group.flow.last), group.counts(), group.failure


def test_sets_of_messages_that_are_near_each_other_need_no_engine(monkeypatch):
    played = _Played(FLOWS[-1], _AT_ONCE[1], {0, 1, 2})
    monkeypatch.setattr(SyncGroup, "add", None)
    _, last, *_ = played.play([[(index, index, False) for index in range(3)]] * 400)
    assert (len(last), played.n_sets) == (RECENT, 399)


@pytest.mark.parametrize("keys", _AT_ONCE)
def test_sets_that_leave_at_once_need_no_engine(keys, monkeypatch):
    played = _Played(FLOWS[-1], keys, {0, 1, 2})
    monkeypatch.setattr(SyncGroup, "add", None)
    _, last, *_ = played.play([[(index, 0, False) for index in range(3)]] * 400)
    assert len(last) == RECENT
    assert (last[-1], played.n_sets) == ((BEGIN + 10 * 1197 * MS,) * 3, 400)


@given(st.binary(max_size=16))
@example(vector(-1))
@example(vector(2**31 * 10**9 - 1, little_endian=False))
@example(b"\x00\x07\x00\x00\x01\x00\x00\x00\xff\xc9\x9a\x3b")
@example(b"\x00\x06\x00\x00\x80\x00\x00\x00\x3b\x9a\xca\x00")
def test_the_same_stamp_is_read(content):
    assert import_module("syncrelay.ros.compiled.path").stamp_of(content) == read_stamp(content)
