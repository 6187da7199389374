"""The simulated DDS: what it must have in common with the real one, whatever befalls its processes."""

from itertools import count
from random import Random

import pytest

from syncrelay.config.profile import Profile
from tests.simulated.bus import Bus, Weather
from tests.simulated.scheduler import MS, SECOND, Process, Scheduler


@pytest.mark.parametrize("seed", range(10))
def test_a_reliable_reader_gets_all_in_order_whatever_is_lost_and_however_long_it_stands_still(seed):
    chance, numbers = Random(seed), count()
    taken: list[int] = []

    def take() -> None:
        while sample := reader.take():
            taken.append(sample[0].number)

    with Scheduler(seed) as scheduler:
        bus, profile = Bus(scheduler, Weather(loss=0.3)), Profile(depth=100)
        reading = Process(scheduler, "reader")
        reader = bus.participant(reading).node("reader").reader("/t", "a/msg/B", profile, take)
        writer = bus.participant(Process(scheduler, "writer")).node("writer").writer("/t", "a/msg/B", profile)
        scheduler.wait_until(lambda: writer.n_readers and reader.n_writers)
        for _ in range(5):
            for _ in range(10):
                writer.write(b"%d" % next(numbers))
                scheduler.sleep(chance.random())
            reading.stall(chance.randrange(MS, 8 * SECOND))
        scheduler.wait_until(lambda: writer.is_acknowledged)
    assert taken == list(range(50))
