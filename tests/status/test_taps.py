"""What taps receive: each line once and in order, or how many they missed."""

import itertools
import json
import sys
import threading
from contextlib import ExitStack
from itertools import pairwise

import pytest

from syncrelay.config import load_text
from syncrelay.dataflow.group import GroupRelay
from syncrelay.explain import RecentDrop, Tape
from syncrelay.explain.tape import KEPT, UNHEARD_S
from syncrelay.runtime import SystemRuntime
from syncrelay.status import Taps
from syncrelay.status.taps import MOST_TAPS, TapRefusedError
from syncrelay.sync import DropReason
from tests.dataflow.payloads import FLOWS, Named
from tests.status.support.serving import asked, connected, serving
from tests.status.support.states import BEGAN, MS, TEXT, relay, working

(GROUP,) = load_text(TEXT).groups
DROP = RecentDrop(1, BEGAN, DropReason.LATE)
# One that uses no processor, of which taps have only a share.
UNLIMITED = SystemRuntime()
UNLIMITED.thread_time_ns = lambda: 0


class Reader:
    """Reads a tap as a client does."""

    def __init__(self, taps: Taps, name: str = "a", wanted: str = "") -> None:
        self._taps, self._query = taps, f"tap={name}{wanted}"
        self.after = json.loads(taps.answer(self._query))["after"]
        self.lost: int | None = 0

    def told(self) -> dict:
        return json.loads(self._taps.answer(f"{self._query}&after={self.after}"))

    def read(self) -> list[dict]:
        """All lines up to now."""
        lines, more = [], True
        while more:
            told = self.told()
            self.after, more = told["after"], told["more"]
            self.lost = None if told["lost"] is None else self.lost + told["lost"]
            lines += told["lines"]
        return lines


@pytest.fixture
def taps() -> Taps:
    return Taps(Tape(), lambda topic: f"/robot{topic}", runtime=UNLIMITED)


def note(taps: Taps, count: int, *, begin: int = 0) -> None:
    for number in range(begin, begin + count):
        taps.tape.note(GROUP, (BEGAN + number, BEGAN + 5 * MS), BEGAN + 9 * MS, BEGAN + 7 * MS)


@pytest.mark.parametrize("flow", FLOWS)
def test_sets_and_drops_are_told_in_the_order_in_which_they_left(taps, flow):
    group = GroupRelay(GROUP, now=lambda: 0, flow=flow, tape=taps.tape)

    def feed(topic: int, stamp_ms: int) -> None:
        group.flow.receive(topic, Named("x", BEGAN), BEGAN + stamp_ms * MS)

    feed(0, -90)
    feed(1, -90)
    reader = Reader(taps)
    for stamp in (0, 100, 200):
        feed(0, stamp)
        feed(1, stamp + 5)
    feed(0, 50)
    lines = reader.read()
    assert [line.get("reason") or line["stamps"]["/robot/camera"] - BEGAN for line in lines] == [0, 100 * MS, "late"]
    a_set, *_, late = lines
    assert a_set == {
        "group": "front",
        "time": a_set["time"],
        "stamps": {"/robot/camera": BEGAN, "/robot/lidar": BEGAN + 5 * MS},
        "offsets": {},
        "span": 5 * MS,
        "latency": a_set["time"] - BEGAN,
        "missing": [],
    }
    assert late == {
        "group": "front",
        "time": late["time"],
        "topic": "/robot/camera",
        "stamp": BEGAN + 50 * MS,
        "received": BEGAN,
        "reason": "late",
    }
    assert reader.read() == []


@pytest.mark.parametrize("flow", FLOWS)
def test_nothing_is_noted_while_nobody_taps(taps, flow):
    group = GroupRelay(GROUP, now=lambda: 0, flow=flow, tape=taps.tape)
    group.flow.receive(0, Named("x", BEGAN), None)
    assert taps.tape.last == 0
    Reader(taps)
    group.flow.receive(0, Named("x", BEGAN), None)
    assert taps.tape.last == 1


def test_a_slow_tap_is_told_how_much_it_lost_and_a_fast_one_loses_nothing(taps):
    slow, fast = Reader(taps, "slow"), Reader(taps, "fast")
    seen = []
    for begin in range(0, KEPT + 300, 100):
        note(taps, 100, begin=begin)
        seen += fast.read()
    assert [line["stamps"]["/robot/camera"] - BEGAN for line in seen] == list(range(KEPT + 300))
    assert fast.lost == 0
    assert len(slow.read()) == KEPT
    assert slow.lost == 300


@pytest.mark.parametrize(
    ("wanted", "kinds"),
    [
        ("", ["set", "late"]),
        ("&drops=1", ["late"]),
        ("&group=front", ["set", "late"]),
        ("&group=rear", []),
        ("&input=/robot/lidar", ["set", "late"]),
        ("&input=/robot/camera", ["set"]),
        ("&input=%2Frobot%2Fcamera&drops=1", []),
        ("&reason=late", ["late"]),
        ("&reason=overflow&reason=late&group=front", ["late"]),
        ("&reason=overflow", []),
    ],
)
def test_only_what_is_wanted_is_told(taps, wanted, kinds):
    reader = Reader(taps, wanted=wanted)
    note(taps, 1)
    taps.tape.note(GROUP, DROP, BEGAN, BEGAN)
    assert [line.get("reason", "set") for line in reader.read()] == kinds


def test_an_input_that_a_set_lacks_has_nothing_to_do_with_it(taps):
    reader = Reader(taps, wanted="&input=/robot/lidar")
    taps.tape.note(GROUP, (BEGAN, None), BEGAN, BEGAN)
    assert reader.read() == []


def test_a_tap_that_was_away_for_long_is_told_that_nobody_counted(taps):
    reader = Reader(taps)
    note(taps, 3)
    other = Taps(taps.tape, str)
    told = json.loads(other.answer(f"tap=a&after={reader.after}"))
    assert told == {"after": 3, "more": False, "lost": None, "lines": []}


def test_what_leaves_is_noted_no_more_once_nobody_asks():
    runtime, seconds = SystemRuntime(), [0.0]
    runtime.monotonic = lambda: seconds[0]
    taps = Taps(Tape(runtime=runtime), str)
    Reader(taps)
    seconds[0] = UNHEARD_S
    note(taps, 1024)
    assert taps.tape.is_on
    seconds[0] += 1
    note(taps, 1024)
    assert not taps.tape.is_on
    assert taps.tape.after(0, most=9999) == ([], 0)


def test_a_number_of_another_run_is_no_number_of_this_one(taps):
    Reader(taps)
    assert json.loads(taps.answer("tap=a&after=99999"))["lost"] is None


def test_taps_that_take_too_much_of_the_processor_are_given_nothing_for_a_while():
    runtime, taken = SystemRuntime(), itertools.count(step=60 * 1000 * MS)
    runtime.thread_time_ns = lambda: next(taken)
    taps = Taps(Tape(), str, runtime=runtime)
    reader, other = Reader(taps), Reader(taps, "b")
    note(taps, 2)
    assert len(reader.read()) == 2
    assert (other.read(), other.after, other.lost) == ([], 0, 0)


def test_so_many_taps_are_answered_and_not_one_more(taps):
    readers = [Reader(taps, f"n{number}") for number in range(MOST_TAPS)]
    with pytest.raises(TapRefusedError, match="64 taps follow this relay already: end one of them first"):
        Reader(taps, "more")
    note(taps, 1)
    assert [len(reader.read()) for reader in readers] == [1] * MOST_TAPS


@pytest.mark.parametrize(
    ("query", "text"),
    [
        ("", "expected `tap`"),
        ("tap=", "expected `tap`"),
        ("tap=a%20b", "expected `tap`"),
        (f"tap={'a' * 33}", "expected `tap`"),
        ("tap=a&after=-1", "expected `after`"),
        ("tap=a&after=1e9", "expected `after`"),
        (f"tap=a&after={'9' * 19}", "expected `after`"),
        ("tap=a&reason=lat", "expected as `reason` one of late"),
        ("tap=a&groups=front", "there is no 'groups'"),
        ("tap=a&group=zz", f"there is no group 'zz': expected {GROUP.name}\n"),
        ("tap=a&group=%ff", "not a valid /tap query"),
        ("tap=a" + "&group=x" * 100, "not a valid /tap query"),
    ],
)
def test_a_query_that_makes_no_sense_is_a_bad_request(query, text):
    with serving(relay(working())) as address:
        code, body = asked(address, f"/tap?{query}")
    assert code == 400
    assert text in body


def test_fifty_taps_that_stall_keep_nobody_from_an_answer_and_hold_back_no_set():
    taps = Taps(Tape(), str, runtime=UNLIMITED)
    with serving(relay(working()), taps=taps) as address, ExitStack() as stack:
        reader = Reader(taps)
        for number in range(50):
            ask = f"GET /tap?tap=n{number}&after=0 HTTP/1.1\r\nHost: localhost\r\n\r\n".encode()
            stack.enter_context(connected(address)).sendall(ask * 20)
        note(taps, 500)
        assert len(reader.read()) == 500
        assert asked(address, "/livez")[0] == 200


def test_what_is_noted_while_it_is_read_is_neither_lost_nor_told_twice(taps):
    reader, count = Reader(taps), 20_000
    noting = threading.Thread(target=note, args=(taps, count))
    usual = sys.getswitchinterval()
    # Switch threads as often as possible.
    sys.setswitchinterval(1e-6)
    try:
        noting.start()
        lines = []
        while noting.is_alive():
            lines += reader.read()
        noting.join()
    finally:
        sys.setswitchinterval(usual)
    lines += reader.read()
    stamps = [line["stamps"]["/robot/camera"] for line in lines]
    assert all(one < other for one, other in pairwise(stamps))
    assert reader.lost is not None
    assert len(stamps) + reader.lost == count
