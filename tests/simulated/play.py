"""Plays a plan, and tells what did not hold; finds the smallest plan that still fails."""

import gc
import logging
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple

from syncrelay.collector import eased_collector
from tests.simulated.faults import KINDS, needs
from tests.simulated.plan import Plan, draw
from tests.simulated.promises import Promises
from tests.simulated.scheduler import MS, SECOND, StuckError
from tests.simulated.world import Line, RelayProcess, World

_LOG: Final = logging.getLogger("syncrelay")
_LOOK_S: Final = 1.0
_ENDS_S: Final = 20.0


class Played(NamedTuple):
    """How a plan went."""

    plan: Plan
    broken: list[str]
    lines: list[Line]
    seconds: float
    """In simulated time."""


class _Recorder(logging.Handler):
    def __init__(self, world: World) -> None:
        super().__init__()
        self._world = world

    def emit(self, record: logging.LogRecord) -> None:
        text = record.getMessage()
        if record.exc_info:
            text += "\n" + logging.Formatter().formatException(record.exc_info)
        # Each play has a folder of its own.
        text = text.replace(f"{self._world.path.parent}/", "")
        self._world.lines.append(Line(self._world.now, record.levelno, text))


def play(plan: Plan) -> Played:
    """Play a plan to its end."""
    with tempfile.TemporaryDirectory(prefix="syncrelay-world-") as folder:
        world = World(plan, Path(folder))
        promises = Promises(world)
        try:
            with _recorded(world), world.scheduler:
                broken = _run(world, promises)
        finally:
            _LOG.handlers[:] = [each for each in _LOG.handlers if not isinstance(each, logging.NullHandler)]
        return Played(plan, broken, world.lines, world.now)


def _run(world: World, promises: Promises) -> list[str]:
    scheduler, plan = world.scheduler, world.plan
    world.start()
    for step in plan.steps:
        happen = partial(_happen, world, step.kind, step.target, step.seconds)
        scheduler.after(round(step.at * SECOND), partial(world.upon_arrival, happen) if plan.prompt else happen)
    try:
        while world.now < plan.length:
            scheduler.sleep(_LOOK_S)
            promises.look()
        relay = world.relay
        if relay is not None:
            _end(world, relay)
            latest = world.now + _ENDS_S
            while not relay.has_ended and world.now < latest:
                scheduler.sleep(0.1)
            if not relay.has_ended:
                promises.broken.append(f"the relay has not ended:\n{scheduler.describe()}")
            if relay.left:
                promises.broken.append(f"the relay has ended, but not its {relay.left}")
    except StuckError as error:
        promises.broken.append(f"{world.now:.2f} s: {error}")
    except Exception as error:  # noqa: BLE001  what the relay's threads raise
        promises.broken.append(f"{world.now:.2f} s: {error!r}\n{_trace(error)}")
    return promises.judge()


def _end(world: World, relay: RelayProcess) -> None:
    """Send SIGTERM while clients call, some of them too late."""
    scheduler, chance = world.scheduler, world.random
    for service in chance.choices(("status", "pause", "resume", "reload"), k=chance.randrange(6)):
        scheduler.after(chance.randrange(300 * MS), partial(world.ask, service))
    at = chance.randrange(MS, 200 * MS)
    if world.plan.is_managed:
        # It is served at the moment of the end.
        scheduler.after(at - MS, partial(world.transit, "deactivate"))
    scheduler.after(at, relay.end)


def _trace(error: BaseException) -> str:
    return logging.Formatter().formatException((type(error), error, error.__traceback__))


def _happen(world: World, kind: str, target: str, seconds: float) -> None:
    end = KINDS[kind].begin(world, target, seconds)
    if end is not None:
        world.scheduler.after(round(seconds * SECOND), end)


@contextmanager
def _recorded(world: World) -> Iterator[None]:
    recorder, level, propagate = _Recorder(world), _LOG.level, _LOG.propagate
    handlers, _LOG.handlers = _LOG.handlers, [recorder]
    _LOG.setLevel(logging.INFO)
    _LOG.propagate = False
    try:
        with eased_collector():
            yield
    finally:
        _LOG.handlers, _LOG.propagate = handlers, propagate
        _LOG.setLevel(level)
        gc.collect(0)


def world_of(seed: int) -> Plan:
    """Return the plan of a seed."""
    return draw(seed, needs())


def shrunk(plan: Plan, *, tries: int = 60, told: Callable[[Plan], object] = lambda _: None) -> Played:
    """Return the smallest plan found that still breaks a promise, and how it went."""
    played = play(plan)
    while True:
        for smaller in played.plan.smaller():
            tries -= 1
            if tries < 0:
                return played
            again = play(smaller)
            if again.broken:
                played = again
                told(smaller)
                break
        else:
            return played
