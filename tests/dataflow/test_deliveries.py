"""What came of each publisher, by the numbers that its messages have, against who knows what was sent."""

from collections import Counter

from hypothesis import given
from hypothesis import strategies as st

from syncrelay.dataflow.deliveries import LARGEST_GAP, MOST_PUBLISHERS, Deliveries, Tally
from syncrelay.dataflow.observers import Senders
from syncrelay.explain import Endpoint

_MS = 1_000_000
_TYPE = "sensor_msgs/msg/Imu"
_WAY = 3 * _MS


class _Publishers:
    """Publishers that number their messages, of which some do not arrive: the truth beside what is counted."""

    def __init__(self, *, with_gids: bool) -> None:
        self.tally, self.senders = Tally(), Senders()
        self.nodes: dict[bytes, str] = {}
        self.sent: Counter[str] = Counter()
        self.delivered: Counter[str] = Counter()
        self._with_gids = with_gids
        self._numbers: Counter[bytes] = Counter()
        self._unheard: Counter[bytes] = Counter()
        self._now = 0

    def publish(self, gid: bytes, *, arrives: bool) -> None:
        self._now += 10 * _MS
        self._numbers[gid] += 1
        self._unheard[gid] += 1
        if arrives:
            node = self.nodes[gid]
            # What was sent before the first that comes is no loss, and of the last it is not known yet.
            self.sent[node] += self._unheard[gid] if self._unheard[gid] != self._numbers[gid] else 1
            self.delivered[node] += 1
            self._unheard[gid] = 0
            self.tally.note(gid if self._with_gids else None, self._numbers[gid], self._now, self._now + _WAY)

    def observe(self) -> None:
        endpoints = [Endpoint(node, _TYPE, gid=gid) for gid, node in self.nodes.items()]
        self.senders.observe(self.tally.read(), endpoints)

    def told(self) -> dict[str, tuple[int, int]]:
        return {each.node: (each.sent_in_all, each.delivered_in_all) for each in self.senders.recent}

    def truth(self) -> dict[str, tuple[int, int]]:
        return {node: (self.sent[node], self.delivered[node]) for node in self.delivered}


_STEPS = st.lists(st.tuples(st.integers(0, 3), st.sampled_from(["arrives", "arrives", "is lost", "restarts", "look"])))


@given(_STEPS)
def test_the_counts_are_those_of_whoever_sent(steps):
    all_of = _Publishers(with_gids=True)
    lives: Counter[int] = Counter()
    for number, what in steps:
        lives[number] += what == "restarts"
        gid = bytes([number, lives[number]])
        all_of.nodes = {each: node for each, node in all_of.nodes.items() if each[0] != number}
        all_of.nodes[gid] = f"/node_{number % 3}"
        if what == "look":
            all_of.observe()
        elif what != "restarts":
            all_of.publish(gid, arrives=what == "arrives")
            all_of.observe()
    assert all_of.told() == all_of.truth()


@given(st.lists(st.sampled_from(["arrives", "arrives", "is lost", "look"])))
def test_without_gids_they_are_right_of_one_publisher_from_when_it_is_known(steps):
    one = _Publishers(with_gids=False)
    one.nodes = {b"a": "/a"}
    one.publish(b"a", arrives=True)
    one.observe()
    before = one.truth()["/a"]
    for what in steps:
        if what == "look":
            one.observe()
        else:
            one.publish(b"a", arrives=what == "arrives")
    one.observe()
    (sent, delivered), (truly_sent, truly_delivered) = one.told()["/a"], one.truth()["/a"]
    assert (sent, delivered) == (truly_sent - before[0], truly_delivered - before[1])


def test_without_gids_nothing_is_known_of_several_publishers():
    two = _Publishers(with_gids=False)
    two.nodes = {b"a": "/a", b"b": "/b"}
    for _ in range(20):
        two.publish(b"a", arrives=True)
        two.publish(b"b", arrives=True)
        two.observe()
    assert two.told() == {}
    # One of them has left, and its numbers are in what was counted last.
    del two.nodes[b"b"]
    for _ in range(20):
        two.publish(b"a", arrives=True)
        two.observe()
    assert two.told() == {"/a": (19, 19)}


def test_the_longest_gap_and_the_least_way_are_those_since_the_last_look():
    tally = Tally()
    for number, way in (3, 50), (4, 20), (9, 30):
        tally.note(b"a", number, 1000, 1000 + way)
    tally.note(b"b", None, 1000, 2000)
    assert tally.read() == [Deliveries(b"a", 3, 9, 3, 1000, longest_gap=4, least_way=20)]
    assert tally.read() == [Deliveries(b"a", 3, 9, 3, 1000, longest_gap=0, least_way=None)]
    newest = 9 + LARGEST_GAP + 1
    tally.note(b"a", newest, 1000, 1000)
    assert [(each.sent, each.longest_gap) for each in tally.read()] == [(newest - 2, LARGEST_GAP)]
    tally.note(b"a", newest + LARGEST_GAP + 2, 1000, 1000)
    assert [each.sent for each in tally.read()] == [1]


def test_of_too_many_publishers_the_one_that_was_silent_for_longest_is_forgotten():
    tally = Tally()
    for gid in (*range(MOST_PUBLISHERS), 0, MOST_PUBLISHERS):
        tally.note(bytes([gid]), 1, 0, 0)
    assert {each.gid for each in tally.read()} == {bytes([gid]) for gid in range(MOST_PUBLISHERS + 1) if gid != 1}


def test_what_is_told_of_the_last_ten_looks():
    rig = _Publishers(with_gids=True)
    rig.nodes = {b"a": "/a"}
    for _ in range(12):
        for arrives in (True, False, False, True, True):
            rig.publish(b"a", arrives=arrives)
        rig.observe()
    (sender,) = rig.senders.recent
    assert (sender.sent, sender.delivered, sender.lost, sender.longest_gap) == (50, 30, 20, 2)
    assert (sender.sent_hz, sender.way) == (100, _WAY)
    for _ in range(10):
        rig.observe()
    (sender,) = rig.senders.recent
    assert (sender.sent, sender.lost, sender.way, sender.sent_in_all) == (0, 0, None, 60)


def test_the_nodes_that_are_remembered_are_few():
    rig = Senders()
    for number in range(100):
        gid = number.to_bytes(2)
        deliveries = [Deliveries(gid, 1, 2, 1, 0, 0, None)]
        rig.observe(deliveries, [Endpoint(f"/n{number}", _TYPE, gid=gid)])
        for _ in range(10):
            rig.observe((), ())
    assert [each.node for each in rig.recent] == [f"/n{number}" for number in range(100 - MOST_PUBLISHERS, 100)]
