"""What a reload does with the groups that run: decided here for the relay that does it, and for who asks beforehand."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

from syncrelay.config.load import Config
from syncrelay.config.resolved import GroupConfig, TopicConfig
from syncrelay.config.wording import counted


@dataclass(frozen=True, slots=True)
class Exchange:
    """Groups by their names: those that a reload leaves alone, builds anew, starts and ends."""

    kept: tuple[str, ...]
    rebuilt: tuple[str, ...]
    started: tuple[str, ...]
    ended: tuple[str, ...]

    def __str__(self) -> str:
        parts = {"rebuilt": self.rebuilt, "started": self.started, "ended": self.ended}
        told = [f"{verb} {', '.join(those)}" for verb, those in parts.items() if those]
        return "; ".join([f"reloaded: {counted(len(self.kept), 'group')} unchanged", *told])


def exchange(
    running: Sequence[GroupConfig], asked: Sequence[GroupConfig], *, stopped: Collection[str] = ()
) -> Exchange:
    """Return what becomes of the groups that run when these are asked for; those that a bug has stopped begin anew."""
    before = {group.name: group for group in running}
    names = [group.name for group in asked]
    kept = [group.name for group in asked if group.name not in stopped and before.get(group.name) == group]
    return Exchange(
        kept=tuple(kept),
        rebuilt=tuple(name for name in names if name in before and name not in kept),
        started=tuple(name for name in names if name not in before),
        ended=tuple(name for name in before if name not in names),
    )


def needs_restart(running: Config, asked: Config) -> tuple[str, ...]:
    """Return the keys of the file that a running relay cannot take on."""
    pairs = {"node": (running.node, asked.node), "metrics": (running.listen, asked.listen)}
    return tuple(key for key, (before, now) in pairs.items() if before != now)


class Subscription(NamedTuple):
    """What a subscription is for: inputs of which this is equal share one, and it outlives the groups that use it.

    `topic` is its name in the graph; `type` is None where the graph tells it.
    """

    topic: str
    type: str | None
    qos: str

    @classmethod
    def of(cls, config: TopicConfig, *, topic: str) -> Self:
        """Return the subscription of an input."""
        return cls(topic, config.type, repr(config.qos))
