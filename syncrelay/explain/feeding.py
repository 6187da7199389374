"""Columns of messages fed to an engine, and what leaves it as columns.

While an engine lends (see SyncGroup.lend), compiled code takes its place, at a tenth of the cost, where it is built.
"""

from array import array
from collections.abc import Callable, Iterable, Sequence
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Final

import numpy as np

from syncrelay.clock import UNREADABLE
from syncrelay.explain.dry_run import EngineDriver
from syncrelay.explain.received import Messages
from syncrelay.explain.rows import Numbers
from syncrelay.sync import DropReason, Match, Outcome
from syncrelay.sync.compiled import source_fingerprint

REASONS: Final = tuple(DropReason)
"""What the numbers in the rows of drops stand for."""

_NUMBERS: Final = {reason: number for number, reason in enumerate(REASONS)}
_LONGEST: Final = 2**63 - 1
# So many messages are fed to an engine before it is asked again whether it lends, as that costs as much as some.
_UNTIL_ASKED: Final = 32


def _compiled() -> Callable[..., int] | None:
    """Return the compiled `feed`; None where it is not built, or of another source."""
    spec, fingerprint = find_spec("syncrelay.sync.compiled.columns"), source_fingerprint()
    if spec is None or (fingerprint is not None and fingerprint.encode() not in Path(str(spec.origin)).read_bytes()):
        return None
    feed_lent: Callable[..., int] = import_module(spec.name).feed
    return feed_lent


_FEED_LENT: Final = _compiled()


class Left:
    """What left an engine: rows of sets and of drops, until they are taken.

    A set is the stamps in input order (UNREADABLE where one is missing), the tick (UNREADABLE without one), when it
    left and its latency; a drop is the input, the stamp, the time of receipt and the number of the reason.
    """

    def __init__(self, n_inputs: int) -> None:
        self._n_inputs = n_inputs
        self.sets, self.drops = array("q"), array("q")

    def add(self, outcomes: Sequence[Outcome], now: int) -> None:
        """Add what leaves together, at a time."""
        for outcome in outcomes:
            if isinstance(outcome, Match):
                complete = 0
                for message in outcome.messages:
                    if message is None:
                        self.sets.append(UNREADABLE)
                    else:
                        self.sets.append(message.stamp)
                        complete = max(complete, message.payload)
                tick = UNREADABLE if outcome.tick is None else outcome.tick
                self.sets.extend((tick, min(now, _LONGEST), min(now - complete, _LONGEST)))
            else:
                message = outcome.message
                self.drops.extend((message.input, message.stamp, message.payload, _NUMBERS[outcome.reason]))

    def taken(self) -> tuple[Numbers, Numbers]:
        """Return the rows of sets and of drops since this was last called."""
        sets = np.frombuffer(self.sets, dtype=np.int64).reshape(-1, self._n_inputs + 3)
        drops = np.frombuffer(self.drops, dtype=np.int64).reshape(-1, 4)
        self.sets, self.drops = array("q"), array("q")
        return sets, drops


def feed(driver: EngineDriver, messages: Messages, left: Left) -> int:
    """Feed messages to an engine whose driver tells `left`; return when the last was received, 0 without any."""
    engine, count, at = driver.engine, len(messages.inputs), 0
    is_plain = messages.keys is None and messages.frames is None
    may_lend = is_plain and (engine.at_once is not None or engine.search_terms is not None)
    while at < count:
        if may_lend and _FEED_LENT is not None:
            at = _FEED_LENT(engine, *messages[:3], at, left.sets, left.drops, UNREADABLE)
        until = at + _UNTIL_ASKED if may_lend else count
        driver.feed(messages.part(at, until).one_by_one())
        at = until
    return int(messages.received[-1]) if count else 0


def numbers_of(reasons: Iterable[DropReason]) -> list[int]:
    """Return the numbers that stand for reasons in the rows of drops."""
    return [_NUMBERS[reason] for reason in reasons]
