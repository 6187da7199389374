"""What a screen shows at one moment: the last state of a relay, and how it stands with the relay since."""

from dataclasses import dataclass
from enum import Enum
from typing import Final

from rich.text import Text

from syncrelay.status import Level, advice
from syncrelay.status.document import Group
from syncrelay.top import phrases
from syncrelay.top.client import Answer
from syncrelay.top.pieces import STYLES, line, wrapped

_WORST_FIRST: Final = (Level.ERROR, Level.STALE, Level.WARN, Level.OK)


class Order(Enum):
    """How groups are sorted."""

    FILE = "file"
    WORST = "worst"
    NAME = "name"

    def following(self) -> "Order":
        """Return the next one, the first after the last."""
        orders = list(Order)
        return orders[(orders.index(self) + 1) % len(orders)]


@dataclass(frozen=True, slots=True)
class View:
    """The last answer; `trouble` says why there is no newer one, `quiet_s` for how long."""

    answer: Answer
    trouble: str | None = None
    quiet_s: float = 0.0
    paused: bool = False

    @property
    def is_stale(self) -> bool:
        """Whether what is shown may not be so any more."""
        return self.trouble is not None

    def group(self, name: str) -> Group | None:
        """Return a group by its name, None where it is gone."""
        return next((group for group in self.answer.state.groups if group.name == name), None)

    def groups(self, order: Order) -> list[Group]:
        """Return the groups in an order; those that are equal in it stay as in the file."""
        groups = list(self.answer.state.groups)
        match order:
            case Order.FILE:
                return groups
            case Order.WORST:
                return sorted(groups, key=lambda group: _WORST_FIRST.index(group.level))
            case Order.NAME:
                return sorted(groups, key=lambda group: group.name)


def title(view: View, width: int) -> list[Text]:
    """Draw which relay it is and how it fares; more lines say what a managed node needs, or that it is stale."""
    relay = view.answer.state.relay
    fares = f"{phrases.phase(relay)}, up {phrases.seconds(relay.uptime_s)}"
    name = Text.assemble((relay.node, "bold"), f" {phrases.place(relay, view.answer.url.removeprefix('http://'))}")
    name.truncate(max(0, width - len(fares) - 2), overflow="ellipsis", pad=True)
    lines = [line(name, "  ", (fares, "" if relay.ready else STYLES[Level.WARN]))]
    if (needed := advice(relay.phase, relay.node)) is not None:
        lines += wrapped(needed, width, first=Text(""), style=STYLES[Level.WARN])
    if view.trouble is not None:
        lines.append(
            line((f" STALE: no answer for {phrases.seconds(view.quiet_s)}: {view.trouble}; still trying ", "reverse"))
        )
    elif view.paused:
        lines.append(line((" PAUSED: press space to resume ", "reverse")))
    return lines
