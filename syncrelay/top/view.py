"""What a screen shows at one moment: the last status of a relay, and whether the relay still answers."""

from dataclasses import dataclass
from enum import Enum
from itertools import chain, islice
from typing import Final

from rich.text import Text

from syncrelay.status import Level, advice
from syncrelay.status.document import Group, Status, Trouble
from syncrelay.top import phrases
from syncrelay.top.client import Answer
from syncrelay.top.pieces import STYLES, line, wrapped

_WORST_FIRST: Final = (Level.ERROR, Level.STALE, Level.WARN, Level.OK)
# So many causes that hit several groups have room above the groups.
_SHARED: Final = 2


class Order(Enum):
    """How groups are sorted."""

    WORST = "worst"
    FILE = "file"
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
    frozen: bool = False

    @property
    def is_stale(self) -> bool:
        """Whether what is shown may be outdated."""
        return self.trouble is not None

    def group(self, name: str) -> Group | None:
        """Return the group of a name, None where the relay has none."""
        return next((group for group in self.answer.status.groups if group.name == name), None)

    def groups(self, order: Order) -> list[Group]:
        """Return the groups in an order: the worst by their names."""
        groups = list(self.answer.status.groups)
        if order is Order.WORST:
            groups.sort(key=lambda group: (_WORST_FIRST.index(group.level), group.name))
        elif order is Order.NAME:
            groups.sort(key=lambda group: group.name)
        return groups


def holds(group: Group, sought: str) -> bool:
    """Whether a text is a part of a group's name, state, topics or findings, in small letters or capitals."""
    told = [group.name, group.level.name, *(each.topic for each in group.inputs)]
    found = [text for each in group.findings for text in (each.label, each.text)]
    return sought.casefold() in "\n".join(told + found).casefold()


def title(view: View, width: int) -> list[Text]:
    """Draw the sentence on all groups, the relay's name and state, and what hits several groups.

    More lines say what a managed node needs, or that the view is stale.
    """
    relay = view.answer.status.relay
    state = f"{phrases.phase(relay)}, up {phrases.seconds(relay.uptime_s)}"
    name = Text.assemble((relay.node, "bold"), f" {phrases.place(relay, view.answer.url.removeprefix('http://'))}")
    name.truncate(max(0, width - len(state) - 2), overflow="ellipsis", pad=True)
    lines = [
        *_headline(view.answer.status, width),
        line(name, "  ", (state, "" if relay.ready else STYLES[Level.WARN])),
    ]
    lines += chain.from_iterable(_shared(each, width) for each in view.answer.status.troubles if len(each.groups) > 1)
    if (needed := advice(relay.phase, relay.node)) is not None:
        lines += wrapped(needed, width, first=Text(""), style=STYLES[Level.WARN])
    if view.trouble is not None:
        lines.append(
            line((f" STALE: no answer for {phrases.seconds(view.quiet_s)}: {view.trouble}; still trying ", "reverse"))
        )
    elif view.frozen:
        lines.append(line((" FROZEN: press space to go on ", "reverse")))
    return lines


def _headline(status: Status, width: int) -> list[Text]:
    worst = min((_WORST_FIRST.index(group.level) for group in status.groups), default=len(_WORST_FIRST) - 1)
    style = f"bold {STYLES[_WORST_FIRST[worst]]}"
    return [*wrapped(status.headline, width, first=Text(""), style=style)]


def _shared(trouble: Trouble, width: int) -> list[Text]:
    """Draw what several groups suffer of at once: two lines at most, the rest is said of each group."""
    first = Text(f"{len(trouble.groups)} groups: ", "bold")
    return [*islice(wrapped(trouble.text, width, first=first, style=STYLES[trouble.severity]), 2)]
