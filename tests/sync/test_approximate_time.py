import pytest
from timeline import TICK_NS, play_policy

from syncrelay.sync import ApproximateTime


def policy(inputs=2, queue=10, slop=20, **options):
    return ApproximateTime(n_inputs=inputs, queue_size=queue, slop_ns=slop * TICK_NS, **options)


CASES = {
    "equal stamps leave at once": (
        policy(),
        """
        lidar  |a..b
        camera |A..B
        -> A: aA
        -> B: bB
        """,
    ),
    "a set leaves when the next message proves it the best": (
        policy(),
        """
        lidar  |a....b
        camera |.A....
        -> b: aA
        """,
    ),
    "a nearer message replaces the one before, which is superseded": (
        policy(),
        """
        lidar  |a..b....c
        camera |....B....
        -> B: a superseded
        -> c: bB
        """,
    ),
    "what is further than slop from the latest input is too far, slop itself is not": (
        policy(slop=3),
        """
        lidar  |ab.......
        camera |....B....C
        lidar  |........c.
        -> B: a too_far
        -> c: bB
        """,
    ),
    "a queue above its size overflows": (
        policy(queue=2),
        """
        lidar  |abcd
        camera |....
        -> c: a overflow
        -> d: b overflow
        """,
    ),
    "an older message still finds its place in the queue": (
        policy(),
        """
        lidar  |a.b.c.
        camera |..B...
        arrive: a c b B
        -> B: a superseded, bB
        """,
    ),
    "a later message of the same stamp replaces the one before": (
        policy(),
        """
        lidar  |a.....
        lidar  |b.....
        camera |A.....
        arrive: a b A
        -> b: a duplicate
        -> A: bA
        """,
    ),
}


@pytest.mark.parametrize(("subject", "drawing"), CASES.values(), ids=CASES)
def test_drawn(subject, drawing):
    left, drawn = play_policy(subject, drawing)
    assert left == drawn
