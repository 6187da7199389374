"""What a screen shows at one moment: the last status of a relay, and whether the relay still answers."""

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
        """Return the next order, the first after the last."""
        orders = list(Order)
        return orders[(orders.index(self) + 1) % len(orders)]


@dataclass(frozen=True, slots=True)
class View:
    """The last answer; `trouble` says why none came since, for `quiet_s` seconds."""

    answer: Answer
    trouble: str | None = None
    quiet_s: float = 0.0
    paused: bool = False

    @property
    def is_stale(self) -> bool:
        """Whether what is shown may be outdated."""
        return self.trouble is not None

    def group(self, name: str) -> Group | None:
        """Return the group of a name, None where the relay has none."""
        return next((group for group in self.answer.status.groups if group.name == name), None)

    def groups(self, order: Order) -> list[Group]:
        """Return the groups in an order; equal ones stay as in the file."""
        groups = list(self.answer.status.groups)
        if order is Order.WORST:
            groups.sort(key=lambda group: _WORST_FIRST.index(group.level))
        elif order is Order.NAME:
            groups.sort(key=lambda group: group.name)
        return groups


def title(view: View, width: int) -> list[Text]:
    """Draw the relay's name and state; more lines say what a managed node needs, or that the view is stale."""
    relay = view.answer.status.relay
    state = f"{phrases.phase(relay)}, up {phrases.seconds(relay.uptime_s)}"
    name = Text.assemble((relay.node, "bold"), f" {phrases.place(relay, view.answer.url.removeprefix('http://'))}")
    name.truncate(max(0, width - len(state) - 2), overflow="ellipsis", pad=True)
    lines = [line(name, "  ", (state, "" if relay.ready else STYLES[Level.WARN]))]
    if (needed := advice(relay.phase, relay.node)) is not None:
        lines += wrapped(needed, width, first=Text(""), style=STYLES[Level.WARN])
    if view.trouble is not None:
        lines.append(
            line((f" STALE: no answer for {phrases.seconds(view.quiet_s)}: {view.trouble}; still trying ", "reverse"))
        )
    elif view.paused:
        lines.append(line((" PAUSED: press space to resume ", "reverse")))
    return lines
