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


def test_a_search_never_goes_back_to_what_it_has_passed():
    # Long enough to pass many heads at once: those beyond the aim must stay, or they would be passed forever.
    policy = approximate(3, queue=10, slop=30)
    arriving = [(0, 22), (1, 22), (0, 25), (0, 28), (1, 28), (0, 29), (0, 32), (0, 33), (1, 29), (1, 32)]
    for place, stamp in arriving:
        assert not policy.add(Message(place, stamp * TICK_NS, None))
    dropped = [each.message for each in policy.add(Message(2, 34 * TICK_NS, None))]
    assert [(each.input, each.stamp // TICK_NS) for each in dropped] == [
        (0, 22),
        (1, 22),
        (0, 25),
        (0, 28),
        (1, 28),
        (0, 29),
        (1, 29),
    ]


def test_a_better_set_does_not_begin_another_wait():
    policy = approximate(3)
    for index, column in ((0, 0), (1, 5), (2, 3)):
        policy.add(Message(index, column * TICK_NS, None))
    assert (policy.waits_started, policy.waits_ended) == (1, 0)
    assert len(policy.add(Message(0, 2 * TICK_NS, None))) == 1
    assert (policy.waits_started, policy.waits_ended) == (1, 0)
