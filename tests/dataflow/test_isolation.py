"""An exception in one group stops that group: its neighbours go on, and so does the thread that feeds them all."""

import random
import time
from functools import partial
from threading import Thread

import pytest

from syncrelay.dataflow.backend import PublishError
from syncrelay.dataflow.bugs import Bugs, OnceLog
from syncrelay.dataflow.flow import Unpublished
from syncrelay.dataflow.group import GroupRelay
from syncrelay.dataflow.inbox import PolledInbox
from syncrelay.dataflow.receive import ReceiveLoop
from syncrelay.sync import DropReason
from tests.dataflow.payloads import FLOWS, Named, Outlet, Source, connect, group_of
from tests.ros.processes import wait_until
from tests.ros.streams import BEGIN, MS

_STEPS = ("add", "reject", "expire", "flush", "counts", "next_deadline")


@pytest.fixture(params=FLOWS)
def group(request) -> GroupRelay:
    return group_of(max_wait="10ms", flow=request.param)


class _Failing:
    """An engine that does what another does until one of its steps fails."""

    def __init__(self, engine, step: str) -> None:
        self._engine, self._step = engine, step

    def __getattr__(self, name: str):
        if name == self._step:
            raise ZeroDivisionError(name)
        return getattr(self._engine, name)


def _drive(group: GroupRelay, step: str) -> None:
    """What the relay does with a group, in which this step of the engine takes part."""
    match step:
        case "add" | "reject":
            stamp = BEGIN if step == "add" else None
            try:
                group.flow.receive(0, Named(b"late"), stamp)
            except ZeroDivisionError as error:
                group.fail(error)
        case "expire":
            group.expire(BEGIN)
        case "flush":
            group.flush(DropReason.TIME_JUMP)
        case "counts":
            assert len(group.counts()) == 2
        case "next_deadline":
            group.next_deadline()


@pytest.mark.parametrize("failing", _STEPS)
def test_whichever_step_fails_the_group_is_stopped_and_takes_all_steps_from_then_on(
    failing: str, group: GroupRelay, caplog
):
    outlets = [Outlet(), Outlet()]
    connect(group, outlets)
    for index in range(2):
        group.flow.receive(index, Named(b"set"), BEGIN)
    assert [outlet.log for outlet in outlets] == [[b"set"], [b"set"]]
    group.engine = _Failing(group.engine, failing)  # type: ignore[assignment]  # it passes all on
    _drive(group, failing)
    assert group.failure == f"ZeroDivisionError: {failing}"
    for step in _STEPS:
        _drive(group, step)
    for index in range(2):
        group.flow.receive(index, Named(b"more"), BEGIN + MS)
    assert [outlet.log for outlet in outlets] == [[b"set"], [b"set"]]
    assert group.engine.sets == 1
    if failing != "counts":
        assert [(each.fed, each.matched, each.buffered) for each in group.counts()] == [(1, 1, 0), (1, 1, 0)]
    told = [record for record in caplog.records if record.exc_info]
    assert [(record.levelname, record.group, record.finding) for record in told] == [
        ("ERROR", "front", "internal_error")
    ]


@pytest.mark.parametrize("failing", [step for step in _STEPS if step not in ("flush", "counts")])
@pytest.mark.parametrize("waiting", [4])
def test_what_waits_in_a_group_that_is_stopped_is_dropped_and_counted(failing: str, waiting: int, group: GroupRelay):
    for index in range(2):
        group.flow.receive(index, Named(b"set"), BEGIN)
    for number in range(waiting):
        group.flow.receive(0, Named(b"lone"), BEGIN + (1 + number) * MS)
    assert [each.buffered for each in group.counts()] == [waiting, 0]
    group.engine = _Failing(group.engine, failing)  # type: ignore[assignment]  # it passes all on
    _drive(group, failing)
    assert group.failure is not None
    camera, lidar = group.counts()
    assert (camera.fed, camera.matched, camera.dropped) == (1 + waiting, 1, {DropReason.SHUTDOWN: waiting})
    assert (lidar.fed, lidar.matched, lidar.dropped) == (1, 1, {})
    assert [each.buffered for each in (camera, lidar)] == [0, 0]


def test_a_group_that_lost_an_outlet_while_it_was_suspended_lets_no_set_leave_in_part(group: GroupRelay):
    outlets = [Outlet(), Outlet()]
    connect(group, outlets)
    group.flow.receive(0, Named(b"before"), BEGIN)
    group.suspend()
    group.flow.receive(1, Named(b"meanwhile"), BEGIN)
    group.connect(1, outlets[1], restamped=False)
    group.resume()
    assert [outlet.log for outlet in outlets] == [[], []]
    assert [(each.fed, each.dropped) for each in group.counts()] == [(1, {DropReason.SHUTDOWN: 1})] * 2


def test_a_message_that_cannot_be_published_is_counted_and_told_and_the_group_goes_on(group: GroupRelay, caplog):
    caplog.set_level("INFO")
    outlets = [Outlet(), Outlet()]
    connect(group, outlets)
    told = []
    for n in range(5):
        outlets[1].refusal = PublishError("no memory") if n in {2, 3} else None
        for index in range(2):
            group.flow.receive(index, Named(b"%d" % n), BEGIN + n * MS)
        told.append(dict(group.unpublished))
    assert told == [{}, {}, {1: Unpublished(1, "no memory")}, {1: Unpublished(2, "no memory")}, {}]
    assert [outlet.log for outlet in outlets] == [[b"0", b"1", b"2", b"3", b"4"], [b"0", b"1", b"4"]]
    assert group.failure is None
    assert [record.message for record in caplog.records] == [
        "front: a message could not be published on /out: no memory; trying again with the next one",
        "front: publishing on /out again; 2 messages were not published",
    ]


def test_a_line_that_would_repeat_is_logged_once_and_of_bugs_a_hundred(caplog):
    once, bugs = OnceLog(), Bugs()
    for level, text in ((30, "a"), (40, "b"), (30, "a"), (40, "a")):
        once.log(level, text)
    assert [(record.levelno, record.message) for record in caplog.records] == [(30, "a"), (40, "b")]
    for number in (*range(150), 0):
        with bugs.contained("looking"):
            raise ValueError(number)
    assert [str(record.exc_info[1]) for record in caplog.records[2:]] == [str(number) for number in range(100)]


class _Watch:
    """Has all sources ready at each turn, and fails now and then."""

    def __init__(self, chance: random.Random) -> None:
        self._chance = chance
        self.sources: list[Source] = []
        self.timeouts: list[int] = []

    def add(self, source: Source) -> None:
        self.sources.append(source)

    def remove(self, source: Source) -> None:
        self.sources.remove(source)

    def wait(self, _: int):
        _fail_at_times(self._chance)
        return list(self.sources), time.time_ns(), True

    def wake(self) -> None:
        pass

    def close(self) -> None:
        pass


def _fail_at_times(chance: random.Random) -> None:
    if chance.random() < 0.1:
        raise chance.choice([ZeroDivisionError, OSError, MemoryError, RecursionError])("by chance")


@pytest.mark.parametrize("seed", range(10))
def test_the_receive_thread_ends_for_nothing_but_the_end(seed: int):
    """Whatever fails around them, all messages of the other sources are delivered in order, and all calls are made."""
    chance = random.Random(seed)
    told: list[Exception] = []

    def deadline() -> int | None:
        _fail_at_times(chance)
        return chance.choice([None, 0])

    loop = ReceiveLoop(
        PolledInbox(_Watch(chance)),
        now=lambda: 0,
        expire=lambda _: _fail_at_times(chance),
        deadline=deadline,
        on_turn=lambda: _fail_at_times(chance),
        contain=told.append,
    )
    sound = [Source(*(Named(b"%d" % n) for n in range(200))) for _ in range(3)]
    delivered: dict[Source, list[bytes]] = {source: [] for source in sound}
    for source in sound:
        source.deliver = lambda payload, source=source: delivered[source].append(payload.name)
        loop.add(source, told.append)
    ailing = Source(Named(b"a"), OSError("gone"), Named(b"b"))
    lost: list[Exception] = []
    loop.add(ailing, lost.append)
    thread = Thread(target=loop.run)
    thread.start()
    for n in range(20):
        assert loop.call(partial(int, n)).result(timeout=60) == n
        with pytest.raises(KeyError):
            loop.call(lambda: dict[str, object]()["no such"]).result(timeout=60)
    wait_until(lambda: not any(source.messages for source in sound), "all messages")
    loop.stop()
    thread.join(timeout=60)
    assert not thread.is_alive()
    assert [str(error) for error in lost] == ["gone"]
    assert all(messages == [b"%d" % n for n in range(200)] for messages in delivered.values())
    assert told


def test_without_somebody_to_tell_the_loop_raises_what_failed():
    chance = random.Random(1)
    loop = ReceiveLoop(PolledInbox(_Watch(chance)), now=lambda: 0, expire=lambda _: None)
    with pytest.raises((ZeroDivisionError, OSError, MemoryError, RecursionError)):
        loop.run()
