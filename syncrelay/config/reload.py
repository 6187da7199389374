"""What a reload does with the running groups, for the relay and for `diff`."""

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
        changes = [f"{verb} {', '.join(those)}" for verb, those in parts.items() if those]
        return "; ".join([f"reloaded: {counted(len(self.kept), 'group')} unchanged", *changes])


def exchange(
    running: Sequence[GroupConfig], wanted: Sequence[GroupConfig], *, stopped: Collection[str] = ()
) -> Exchange:
    """Return what a reload does with the running groups. A group that a bug has `stopped` is rebuilt."""
    before = {group.name: group for group in running}
    names = [group.name for group in wanted]
    kept = [group.name for group in wanted if group.name not in stopped and before.get(group.name) == group]
    return Exchange(
        kept=tuple(kept),
        rebuilt=tuple(name for name in names if name in before and name not in kept),
        started=tuple(name for name in names if name not in before),
        ended=tuple(name for name in before if name not in names),
    )


def needs_restart(running: Config, wanted: Config) -> tuple[str, ...]:
    """Return the changed keys that only a restart can apply."""
    pairs = {"node": (running.node, wanted.node), "metrics": (running.listen, wanted.listen)}
    return tuple(key for key, (before, now) in pairs.items() if before != now)


class Subscription(NamedTuple):
    """The key of a subscription: inputs with equal keys share one, which stays open across a reload.

    `topic` is its name in the graph; `type` is None if it comes from the graph.
    """

    topic: str
    type: str | None
    qos: str

    @classmethod
    def of(cls, config: TopicConfig, *, topic: str) -> Self:
        """Return the subscription of an input."""
        return cls(topic, config.type, repr(config.qos))
