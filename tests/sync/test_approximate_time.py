from syncrelay.sync import ApproximateTime, Message, SyncGroup
from tests.sync.support.timeline import TICK_NS, play_group


def approximate(inputs, queue=10, slop=20):
    return ApproximateTime(n_inputs=inputs, queue_size=queue, slop_ns=slop * TICK_NS)


def test_an_overflow_is_excused_in_a_long_search_too_once_another_input_has_the_latest_head():
    # Camera and radar take turns, so that each drop is a step of its own.
    drawing = """
        lidar  |..............ABCDEFGHIJK
        camera |..c.e.g.i.......k........
        radar  |.b.d.f.h..l.m............
        imu    |..............n..........
        arrive: A B C D E F G H I J K b c d e f g h i k l m n
    """
    (overflow, search), _ = play_group(SyncGroup(approximate(4, slop=8)), drawing)
    assert overflow == "K: A overflow"
    # The lidar may not be the pivot before k is the latest; then l is no longer too far.
    assert search == "n: " + "".join(f"{letter} too_far, " for letter in "bcdefghi") + "l superseded"


def test_a_better_set_does_not_begin_another_wait():
    policy = approximate(3)
    for index, column in ((0, 0), (1, 5), (2, 3)):
        policy.add(Message(index, column * TICK_NS, None))
    assert (policy.waits_started, policy.waits_ended) == (1, 0)
    assert len(policy.add(Message(0, 2 * TICK_NS, None))) == 1
    assert (policy.waits_started, policy.waits_ended) == (1, 0)
