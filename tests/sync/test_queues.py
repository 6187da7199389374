import pytest

from syncrelay.sync.queues import Losses


@pytest.mark.parametrize(
    ("lost", "wanted", "reach", "needed"),
    [
        # The queue holds 20, 30, 40: with 10 lost, one every 10.
        (10, 10, 0, 5),
        (10, 15, 0, None),  # nothing as new as 15 was lost
        (10, 15, 5, 5),  # what was lost lies just within reach
        (10, 16, 5, None),
        (15, 10, 5, 5),
        (15, 10, 4, None),  # lost, but as far from what is wanted as what is queued
        (20, 10, 0, None),  # lost, but not from before what is queued
        (None, 10, 0, None),
    ],
)
def test_what_was_lost_and_wanted_tells_how_long_a_queue_was_needed(lost, wanted, reach, needed):
    losses = Losses(2)
    if lost is not None:
        losses.lose(1, lost)
    losses.miss(1, [20, 30, 40], wanted, before=reach, after=reach)
    assert losses.needed == [None, needed]


def test_what_was_lost_before_the_newest_that_was_lost_counts():
    losses = Losses(1)
    for stamp in (5, 10, 15, 12):
        losses.lose(0, stamp)
    losses.miss(0, [20, 30], 9, before=0, after=1)
    assert losses.needed == [6]


def test_the_greatest_length_is_kept_but_none_that_no_queue_should_have():
    losses = Losses(2)
    for place, length in ((0, 7), (1, 1001), (0, 9), (1, 1000), (0, 8), (0, 5000)):
        losses.need(place, length)
    assert losses.needed == [9, 1000]


def test_losses_are_forgotten_but_not_what_they_taught():
    losses = Losses(1)
    losses.lose(0, 10)
    losses.miss(0, [20, 30, 40], 10, before=0, after=0)
    losses.forget()
    losses.miss(0, [20, 30, 40], 10, before=0, after=0)
    assert losses.needed == [5]
