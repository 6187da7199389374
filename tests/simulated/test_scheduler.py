"""The scheduler: virtual time, waits, the same order for the same seed, and what it says where nothing goes on."""

import pytest

from syncrelay.runtime import Runtime
from tests.simulated.scheduler import MS, Process, Scheduler, SimulatedRuntime, StuckError


@pytest.fixture
def scheduler():
    with Scheduler(1) as made:
        yield made


@pytest.fixture
def runtime(scheduler) -> Runtime:
    return SimulatedRuntime(Process(scheduler, "relay"))


def test_what_threads_and_events_raise_reaches_the_test(scheduler, runtime):
    def fail():
        raise KeyError(1)

    runtime.start("failing", fail)
    with pytest.raises(KeyError):
        scheduler.sleep(1)
    scheduler.after(MS, fail)
    runtime.start("sleeping", lambda: runtime.sleep(100))
    with pytest.raises(KeyError):
        scheduler.sleep(1)
    scheduler.sleep(1)


def test_waiting_in_vain_is_told_with_the_stack(scheduler, runtime):
    locks = runtime.lock(), runtime.lock()

    def grab(first, second):
        with first:
            runtime.sleep(0.1)
            with second:
                pass

    runtime.start("one", lambda: grab(*locks))
    runtime.start("two", lambda: grab(*reversed(locks)))
    with pytest.raises(StuckError, match=r"waits in vain for a lock that (one|two) holds(.|\n)*with second"):
        scheduler.sleep(1000)


def test_a_busy_loop_is_told(scheduler, runtime):
    def turn():
        while True:
            runtime.sleep(0)

    runtime.start("busy", turn)
    with pytest.raises(StuckError, match="turns at one instant, now of busy"):
        scheduler.sleep(1)
