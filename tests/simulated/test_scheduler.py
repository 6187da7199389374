"""The scheduler: virtual time, waits, the same order for the same seed, and what it says where nothing goes on."""

import time
from concurrent.futures import CancelledError
from functools import partial
from itertools import pairwise

import pytest

from syncrelay.runtime import Runtime
from tests.simulated.scheduler import MS, SECOND, Process, Scheduler, SimulatedRuntime, StuckError


@pytest.fixture
def scheduler():
    with Scheduler(1) as made:
        yield made


@pytest.fixture
def runtime(scheduler) -> Runtime:
    return SimulatedRuntime(Process(scheduler, "relay"))


def test_time_passes_only_while_all_wait(scheduler, runtime):
    began = time.monotonic()
    at = runtime.monotonic_ns()
    seen = []
    scheduler.after(1500 * MS, lambda: seen.append(runtime.monotonic_ns() - at))
    runtime.sleep(3600)
    assert (seen, runtime.monotonic_ns() - at) == ([1500 * MS], 3600 * SECOND)
    assert time.monotonic() - began < 30


def test_futures_give_results_errors_and_timeouts(scheduler, runtime):
    made = [runtime.future() for _ in range(4)]
    done: list[object] = []
    made[0].add_done_callback(done.append)
    scheduler.after(MS, lambda: made[0].set_result(3))
    scheduler.after(2 * MS, lambda: made[1].set_exception(KeyError("x")))
    scheduler.after(3 * MS, made[2].cancel)
    assert made[0].result() == 3
    assert done == [made[0]]
    for future, error in zip(made[1:], (KeyError, CancelledError, TimeoutError), strict=True):
        with pytest.raises(error):
            future.result(5)


def test_a_lock_admits_one(runtime):
    lock = runtime.lock()
    inside: list[None] = []
    most: list[int] = []

    def enter():
        with lock:
            inside.append(None)
            most.append(len(inside))
            runtime.sleep(0.1)
            inside.pop()

    threads = [runtime.start("t", enter) for _ in range(5)]
    for thread in threads:
        thread.join()
    assert most == [1] * 5
    assert not any(thread.is_alive() for thread in threads)


def _trace(seed):
    with Scheduler(seed, eagerness=0.5, lag_ns=20 * MS) as scheduler:
        runtime = SimulatedRuntime(Process(scheduler, "relay"))
        trace, rest = [], runtime.rest()

        def worker(name):
            for _ in range(20):
                trace.append((name, runtime.monotonic_ns()))
                rest.set()
                runtime.sleep(0.01)
                rest.wait(0.001)

        for thread in [runtime.start(name, partial(worker, name)) for name in "abc"]:
            thread.join()
        return trace


def test_the_same_seed_gives_the_same_order_and_others_others():
    assert _trace(7) == _trace(7)
    assert len({tuple(_trace(seed)) for seed in range(5)}) == 5


def test_a_stalled_process_goes_on_where_it_was_and_a_dead_one_does_not(scheduler, runtime):
    turns = []

    def work():
        while True:
            turns.append(scheduler.now)
            runtime.sleep(0.1)

    runtime.start("work", work)
    scheduler.sleep(1.05)
    runtime.process.stall(10 * SECOND)
    scheduler.sleep(11)
    assert max(later - before for before, later in pairwise(turns)) == pytest.approx(10e9, abs=1e8)
    runtime.process.kill()
    count = len(turns)
    scheduler.sleep(11)
    assert len(turns) == count > 20


def test_the_system_clock_can_be_set(runtime):
    before = runtime.time_ns()
    runtime.process.clock_offset -= SECOND
    assert runtime.time_ns() == before - SECOND


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


def test_the_end_runs_what_tasks_leave_behind():
    left = []
    with Scheduler(1) as scheduler:
        runtime = SimulatedRuntime(Process(scheduler, "relay"))

        def work():
            try:
                runtime.sleep(1000)
            finally:
                left.append("left")
                runtime.sleep(1)

        runtime.start("work", work)
        scheduler.sleep(1)
    assert left == ["left"]
