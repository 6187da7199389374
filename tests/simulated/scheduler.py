"""Virtual time and simulated threads: greenlets of which one runs at a time, and a seed picks the next.

Time stands still while any task can run, and then leaps to the next timer. Whoever makes a Scheduler is its first task.
Tasks switch where they wait; with `eagerness`, also where they wake others, take locks or hand on results. With
`lag_ns`, some woken tasks are delayed, up to that long.
"""

import traceback
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from heapq import heappop, heappush
from itertools import count
from math import ceil
from random import Random
from typing import Any, Final, Self

from greenlet import GreenletExit, getcurrent, greenlet

MS: Final = 1_000_000
SECOND: Final = 1_000_000_000
# No time is near 0, as on a machine that has been up for a while.
_UP_NS: Final = 1000 * SECOND
_EPOCH_NS: Final = 1_700_000_000 * SECOND
# Whoever waits for a lock or a future for longer waits in vain.
_LONGEST_WAIT_NS: Final = 300 * SECOND
_LOOK_NS: Final = 30 * SECOND
# More turns of tasks at one instant are a busy loop.
_MOST_TURNS: Final = 200_000


class StuckError(Exception):
    """Tasks that wait for each other, or that turn without end."""


class Process:
    """A simulated process: its system clock, and whether it runs."""

    def __init__(self, scheduler: "Scheduler", name: str) -> None:
        self.scheduler = scheduler
        self.name = name
        self.clock_offset = _EPOCH_NS - _UP_NS
        """What its system clock differs by from monotonic time: set it to step the clock."""
        self.stalled_until = 0
        self.is_dead = False
        self.held: list[Task] = []
        self.on_go_on: list[Callable[[], object]] = []
        """Called when it goes on after a stall."""

    @property
    def is_still(self) -> bool:
        return self.is_dead or self.stalled_until > self.scheduler.now

    def time_ns(self) -> int:
        return self.scheduler.now + self.clock_offset

    def stall(self, duration_ns: int) -> None:
        """Stop it as SIGSTOP does, for so long."""
        self.stalled_until = max(self.stalled_until, self.scheduler.now + duration_ns)
        self.scheduler.at(self.stalled_until, self._go_on)

    def _go_on(self) -> None:
        if not self.is_still:
            held, self.held = self.held, []
            self.scheduler.make_ready(held)
            for each in self.on_go_on:
                each()

    def kill(self) -> None:
        """End it as SIGKILL does: none of its tasks runs again."""
        self.is_dead = True


class Task:
    """A simulated thread."""

    __slots__ = ("greenlet", "in_vain", "is_alive", "name", "process", "since", "timed_out", "turn")

    def __init__(self, name: str, process: Process, run: greenlet) -> None:
        self.name = name
        self.process = process
        self.greenlet = run
        self.turn = 0
        """Which of its waits this is: a wake is for one of them only."""
        self.timed_out = False
        self.in_vain: str | None = None
        """What it waits for without a timeout, and must get."""
        self.since = 0
        self.is_alive = True


class Scheduler:
    """Runs tasks and events. `close` it, or use it as a context manager."""

    def __init__(self, seed: int, *, eagerness: float = 0.0, lag_ns: int = 0) -> None:
        self.seed = seed
        self.now = _UP_NS
        """Monotonic time in nanoseconds."""
        self.eagerness = eagerness
        self.lag_ns = lag_ns
        self._random = self.stream("scheduler").random
        self._timers: list[tuple[int, int, Task | None, Any]] = []
        self._order = count()
        self._ready: list[Task] = []
        self._turns = 0
        self._in_events = self._ending = False
        self.process = Process(self, "test")
        self._main = self.current = Task("main", self.process, getcurrent())
        self._tasks = [self._main]
        self.at(self.now + _LOOK_NS, self._look_for_stuck)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def stream(self, name: str) -> Random:
        """Return random numbers for one purpose: draws for others do not change them."""
        return Random(f"{self.seed} {name}")

    def at(self, when: int, event: Callable[[], object]) -> None:
        """Have an event called at a monotonic time; it must not wait. What it raises ends the simulation."""
        heappush(self._timers, (max(when, self.now), next(self._order), None, event))

    def after(self, delay_ns: int, event: Callable[[], object]) -> None:
        """Have an event called later."""
        heappush(self._timers, (self.now + delay_ns, next(self._order), None, event))

    def start(self, name: str, target: Callable[[], object], process: Process) -> Task:
        """Make a task; what its target raises ends the simulation."""

        def run(*_: object) -> None:
            try:
                target()
            except GreenletExit:
                pass
            except BaseException:
                if self._ending:
                    return
                task.is_alive, self.current = False, self._main
                raise
            task.is_alive = False
            if not self._ending:
                self._tasks.remove(task)
                self.current = self._next()
                task.greenlet.parent = self.current.greenlet

        task = Task(name, process, greenlet(run, self._main.greenlet))
        self._tasks.append(task)
        self._ready.append(task)
        return task

    def wait(self, until: int | None, *, in_vain: str | None = None) -> bool:
        """Let others run until this task is woken, or that time has come; whether it was woken.

        `in_vain` names what must not be waited for forever.
        """
        me = self.current
        me.timed_out = False
        if until is not None:
            heappush(self._timers, (until, next(self._order), me, me.turn))
        else:
            me.in_vain, me.since = in_vain, self.now
        self._switch()
        return not me.timed_out

    def wake(self, task: Task, turn: int) -> None:
        """End a wait, unless it is over: `turn` is the task's as it began."""
        if task.turn != turn:
            return
        task.turn += 1
        task.in_vain = None
        if self.lag_ns and self._random() < _LAGGARDS:
            self.after(int(self.lag_ns * self._random() ** 3), lambda: self._ready.append(task))
        else:
            self._ready.append(task)

    def sleep(self, seconds: float) -> None:
        """Let others run for so long."""
        self.wait(self.now + nanoseconds(seconds))

    def sleep_until(self, when: int) -> None:
        self.wait(max(when, self.now))

    def wait_until(self, condition: Callable[[], object], *, within_s: float = 60.0, every_s: float = 0.02) -> None:
        """Let others run until something holds; raises TimeoutError with what all tasks do."""
        end = self.now + nanoseconds(within_s)
        while not condition():
            if self.now >= end:
                raise TimeoutError(f"not within {within_s:g} s\n{self.describe()}")
            self.sleep(every_s)

    def preempt(self) -> None:
        """Perhaps let others run first."""
        if self.eagerness and not self._in_events and not self._ending and self._random() < self.eagerness:
            self._ready.append(self.current)
            self._switch()

    def note_turn(self) -> None:
        """Note that a task goes on without any time passing; too many such turns are a busy loop."""
        self._turns += 1
        if self._turns > _MOST_TURNS:
            self._fail(StuckError(f"{_MOST_TURNS} turns at one instant, now of {self.current.name}\n{self.describe()}"))

    def make_ready(self, tasks: list[Task]) -> None:
        """Have tasks that were held go on."""
        self._ready += tasks

    def describe(self) -> str:
        """Say where each task is."""
        parts = []
        for task in self._tasks:
            if task is not self.current and (frame := task.greenlet.gr_frame) is not None:
                stack = "".join(traceback.format_stack(frame, limit=8))
                parts.append(
                    f"{task.process.name}: {task.name}, waiting for {task.in_vain or 'time or a wake'}:\n{stack}"
                )
        return "\n".join(parts)

    def close(self) -> None:
        """End all tasks: each raises GreenletExit where it waits."""
        self._ending = True
        for task in self._tasks:
            if task is not self._main and task.is_alive:
                self.current = task
                task.greenlet.throw(GreenletExit)
                task.is_alive = False
        self._tasks, self._timers, self._ready = [self._main], [], []
        self.current = self._main

    def _switch(self) -> None:
        if self._ending:
            raise GreenletExit
        me = self.current
        task = self._next()
        if task is not me:
            self.current = task
            task.greenlet.switch()

    def _next(self) -> Task:
        """Take the task that runs next, after as much time as it takes."""
        ready, now = self._ready, self.now
        self.note_turn()
        while True:
            if not ready:
                self._advance()
                now = self.now
                continue
            if len(ready) == 1:
                task = ready.pop()
            else:
                # random() is ten times as fast as randrange().
                index = int(self._random() * len(ready))
                task, ready[index] = ready[index], ready[-1]
                ready.pop()
            process = task.process
            if not process.is_dead and process.stalled_until <= now:
                return task
            process.held.append(task)

    def _advance(self) -> None:
        """Go to the time of the next timer, and do all that is due then."""
        timers = self._timers
        now = timers[0][0]
        if now > self.now:
            self.now, self._turns = now, 0
        self._in_events = True
        try:
            while timers and timers[0][0] <= now:
                _, _, task, what = heappop(timers)
                if task is None:
                    what()
                elif task.turn == what:
                    task.timed_out = True
                    self.wake(task, what)
        except BaseException as error:  # noqa: BLE001  raised where the test can see it
            self._in_events = False
            self._fail(error)
        self._in_events = False

    def _fail(self, error: BaseException) -> None:
        """Raise an error in the first task."""
        main = self._main
        if self.current is main:
            raise error
        main.turn += 1
        self.current = main
        main.greenlet.throw(error)

    def _look_for_stuck(self) -> None:
        self.after(_LOOK_NS, self._look_for_stuck)
        for task in self._tasks:
            if task.in_vain and not task.process.is_still and self.now - task.since > _LONGEST_WAIT_NS:
                raise StuckError(f"{task.name} waits in vain for {task.in_vain}\n{self.describe()}")


# So many wakes are late.
_LAGGARDS: Final = 0.02


def nanoseconds(seconds: float) -> int:
    """Nanoseconds, rounded up: who waits for any time at all lets some pass."""
    return max(0, ceil(seconds * SECOND))


class SimulatedFuture(Future[Any]):
    """A future on whose result tasks wait."""

    def __init__(self, scheduler: Scheduler) -> None:
        super().__init__()
        self._scheduler = scheduler

    def result(self, timeout: float | None = None) -> Any:
        self._wait(timeout)
        return super().result(0)

    def exception(self, timeout: float | None = None) -> BaseException | None:
        self._wait(timeout)
        return super().exception(0)

    def set_result(self, result: Any) -> None:
        super().set_result(result)
        self._scheduler.preempt()

    def _wait(self, timeout: float | None) -> None:
        if self.done():
            return
        scheduler = self._scheduler
        task, turn = scheduler.current, scheduler.current.turn
        self.add_done_callback(lambda _: scheduler.wake(task, turn))
        scheduler.wait(None if timeout is None else scheduler.now + nanoseconds(timeout), in_vain="a result")


class SimulatedLock:
    """As threading.Lock."""

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._holder: Task | None = None
        self._waiting: list[tuple[Task, int]] = []

    def __enter__(self) -> Self:
        scheduler = self._scheduler
        scheduler.preempt()
        me = scheduler.current
        while self._holder is not None:
            self._waiting.append((me, me.turn))
            scheduler.wait(None, in_vain=f"a lock that {self._holder.name} holds")
        self._holder = me
        return self

    def __exit__(self, *_: object) -> None:
        self._holder = None
        waiting, self._waiting = self._waiting, []
        for task, turn in waiting:
            self._scheduler.wake(task, turn)


class SimulatedRest:
    """As syncrelay.wakeup.Wakeup."""

    __slots__ = ("_is_set", "_scheduler", "_waiting")

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._is_set = False
        self._waiting: tuple[Task, int] | None = None

    def set(self) -> None:
        self._is_set = True
        if self._waiting is not None:
            self._scheduler.wake(*self._waiting)
        self._scheduler.preempt()

    def wait(self, timeout_s: float | None) -> bool:
        return self.wait_ns(None if timeout_s is None else nanoseconds(timeout_s))

    def wait_ns(self, timeout_ns: int | None) -> bool:
        scheduler = self._scheduler
        if not self._is_set and timeout_ns != 0:
            me = scheduler.current
            self._waiting = me, me.turn
            scheduler.wait(None if timeout_ns is None else scheduler.now + timeout_ns)
            self._waiting = None
        else:
            scheduler.preempt()
        was_set, self._is_set = self._is_set, False
        return was_set


class SimulatedThread:
    """A task, to be waited for."""

    def __init__(self, scheduler: Scheduler, name: str, target: Callable[[], object], process: Process) -> None:
        self._returned = SimulatedFuture(scheduler)

        def run() -> None:
            try:
                target()
            finally:
                self._returned.set_result(None)

        scheduler.start(name, run, process)

    def join(self, timeout: float | None = None) -> None:
        with suppress(TimeoutError):
            self._returned.exception(timeout)

    def is_alive(self) -> bool:
        return not self._returned.done()


# What a thread has used between two looks at its own clock, one every 50 messages of a trial: on a slow machine.
_WORK_NS: Final = 2_000_000


class SimulatedRuntime:
    """The clocks, threads and futures of a simulated process: a syncrelay.runtime.Runtime."""

    def __init__(self, process: Process) -> None:
        self.process = process
        self.scheduler = scheduler = process.scheduler
        self.time_ns = process.time_ns
        self.sleep = scheduler.sleep
        self._threads: dict[str, SimulatedThread] = {}
        self.held: set[str] = set()
        """What has to be freed before the process ends."""
        self._used = 0

    def monotonic(self) -> float:
        return self.scheduler.now / SECOND

    def monotonic_ns(self) -> int:
        return self.scheduler.now

    def thread_time_ns(self) -> int:
        # Work takes no time here: who asks has used a little.
        self._used += _WORK_NS
        return self._used

    def lock(self) -> SimulatedLock:
        return SimulatedLock(self.scheduler)

    def rest(self) -> SimulatedRest:
        return SimulatedRest(self.scheduler)

    def future(self) -> SimulatedFuture:
        return SimulatedFuture(self.scheduler)

    def start(self, name: str, target: Callable[[], object], *, daemon: bool = False) -> SimulatedThread:  # noqa: ARG002
        thread = self._threads[name] = SimulatedThread(self.scheduler, name, target, self.process)
        return thread

    def alive(self) -> list[str]:
        """Return the names of the threads that have not ended, the last of each name."""
        return [name for name, thread in self._threads.items() if thread.is_alive()]
