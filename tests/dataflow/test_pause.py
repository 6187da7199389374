"""A paused group: nothing leaves, all that comes is counted, and the sets after it are newer than those before."""

from hypothesis import given
from hypothesis import strategies as st

from syncrelay.dataflow.group import GroupRelay
from syncrelay.sync import DropReason
from tests.dataflow.payloads import PAIR, Named, Outlet, connect, group_of
from tests.ros.cdr_messages import VECTOR
from tests.ros.streams import BEGIN, MS

_WITH_RADAR = [*PAIR, {"topic": "/radar", "type": VECTOR, "required": False}]
_KINDS = {
    "exact_time": {},
    "approximate_time": {"slop": "30ms"},
    "approximate_time_eager": {"slop": "30ms"},
    "approximate_epsilon_time": {"slop": "30ms"},
    "latest_time": {"trigger": "/camera", "max_age": "1s"},
}


def _group(*, now=lambda: 0, **keys) -> tuple[GroupRelay, list[Outlet]]:
    group = group_of(now=now, **keys)
    outlets = [Outlet() for _ in group.config.topics]
    connect(group, outlets)
    return group, outlets


def _give(group: GroupRelay, index: int, ms: int) -> None:
    stamp = BEGIN + ms * MS
    group.flow.receive(index, Named(stamp, stamp), stamp)


def _sent(outlets: list[Outlet]) -> list[list[int]]:
    return [[(stamp - BEGIN) // MS for stamp in outlet.log] for outlet in outlets]


_STEPS = st.lists(
    st.one_of(
        st.tuples(st.integers(0, 2), st.integers(-25, 10)),
        st.sampled_from(["pause", "unpause", "suspend", "expire", "flush", "fail"]),
    ),
    max_size=80,
)


def _take(step: str | tuple[int, int], group: GroupRelay, outlets: list[Outlet], at: int) -> None:
    match step:
        case "suspend":
            group.suspend()
            connect(group, outlets)
            group.resume()
        case "expire":
            group.expire(at * MS)
        case "fail":
            group.fail(ZeroDivisionError("x"))
        case "flush":
            group.flush(DropReason.TIME_JUMP)
        case str():
            getattr(group, step)()
        case index, ahead:
            _give(group, index % len(outlets), 20 * (at + ahead) // 2)


def test_ticks_of_a_pause_give_no_sets_and_what_came_in_it_serves_those_after():
    now = [BEGIN]
    group, outlets = _group(policy="latest_time", trigger="20 Hz", now=lambda: now[0])

    def until(ms: int) -> None:
        now[0] = BEGIN + ms * MS
        group.expire(now[0])

    for index in range(2):
        _give(group, index, 10)
    until(50)
    assert _sent(outlets) == [[10], [10]]
    group.pause()
    until(100)
    for ms in (110, 120):
        _give(group, 1, ms)
    assert group.next_deadline() is None
    now[0] = BEGIN + 210 * MS
    group.unpause()
    until(250)
    assert _sent(outlets) == [[10, 10], [10, 120]]
    assert [dict(each.dropped) for each in group.counts()] == [{}, {DropReason.SUPERSEDED: 1}]


@given(policy=st.sampled_from(sorted(_KINDS)), steps=_STEPS, optional=st.booleans())
def test_all_is_counted_nothing_leaves_while_paused_or_once_it_failed_and_no_set_goes_back(policy, steps, optional):
    keys = {"policy": policy, **_KINDS[policy], **({"max_wait": "5ms", "topics": _WITH_RADAR} if optional else {})}
    group, outlets = _group(**keys)
    for at, step in enumerate(steps):
        before = _sent(outlets)
        _take(step, group, outlets, at)
        if group.paused_since is not None or group.failure is not None:
            assert _sent(outlets) == before
        for each in group.counts():
            assert each.fed == each.matched + sum(each.dropped.values()) + each.buffered
    assert (group.failure is None) == ("fail" not in steps)
    if "flush" not in steps:
        for stamps in _sent(outlets):
            assert stamps == sorted(stamps)
