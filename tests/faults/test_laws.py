"""The law finds what it is there to find: else every test that leans on it would be worth nothing."""

import pytest

from tests.faults.certified import certified, sent_stamp
from tests.faults.laws import SetLaw
from tests.ros.cdr_messages import with_stamp

TOPICS = ["/camera", "/lidar"]
T = 1_700_000_000_000_000_000
SLOP = 10


def judged(*messages: tuple[int, bytes]) -> SetLaw:
    law = SetLaw(TOPICS, slop=SLOP)
    for index, payload in messages:
        law.take(index, payload)
    return law


def camera(stamp: int) -> tuple[int, bytes]:
    return 0, certified("/camera", stamp)


def lidar(stamp: int) -> tuple[int, bytes]:
    return 1, certified("/lidar", stamp)


def restamped(message: tuple[int, bytes], stamp: int) -> tuple[int, bytes]:
    return message[0], with_stamp(message[1], stamp)


def test_a_certified_message_tells_its_stamp_also_when_it_is_restamped():
    payload = certified("/camera", T + 123)
    assert sent_stamp("/camera", payload) == T + 123
    assert sent_stamp("/camera", with_stamp(payload, T)) == T + 123


@pytest.mark.parametrize("place", [*range(4), *range(12, len(certified("/camera", T)))])
def test_a_message_of_which_one_byte_is_another_was_not_sent(place: int):
    payload = bytearray(certified("/camera", T))
    payload[place] ^= 1
    assert sent_stamp("/camera", bytes(payload)) is None


def test_a_message_of_another_topic_or_length_was_not_sent():
    assert sent_stamp("/camera", certified("/lidar", T)) is None
    assert sent_stamp("/camera", certified("/camera", T)[:-1]) is None


def test_right_sets_are_counted():
    law = judged(camera(T), restamped(lidar(T + SLOP), T), camera(T + 100), lidar(T + 100), camera(T + 200))
    assert (law.sets, law.messages, law.unpaired, law.last_set, law.faults) == (2, [3, 2], 1, T + 100, [])


@pytest.mark.parametrize(
    ("messages", "fault"),
    [
        ([camera(T), camera(T)], f"/camera: {T} comes again"),
        ([camera(T), camera(T - 1)], f"/camera: {T - 1} comes after {T}"),
        (
            [camera(T), restamped(lidar(T + SLOP + 1), T)],
            f"a set spans {SLOP + 1} ns, slop is {SLOP}: [{T}, {T + SLOP + 1}]",
        ),
        ([restamped(camera(T), T + 5), lidar(T + 5)], f"a set of [{T}, {T + 5}] left with the stamp {T + 5}"),
        ([(0, b"\0\1\0\0")], "/camera: nobody sent 00010000"),
    ],
    ids=["a message twice", "a step back", "a span over slop", "another stamp", "another message"],
)
def test_what_is_wrong_is_told(messages, fault: str):
    assert judged(*messages).faults == [fault]
